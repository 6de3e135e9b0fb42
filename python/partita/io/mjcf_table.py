"""What becomes of each element and attribute of MJCF. MuJoCo's compiler reads the file; the model is made of what it
compiled, so defaults, frames, replicas and included files count with their values."""

from __future__ import annotations

from .format_table import APPLIED, BOUNDS, COMPILED, DROPPED, LOOKS, NO_EFFECT, OTHER, Rows, Table

_TURN = "@quat @axisangle @euler @xyaxes @zaxis"
CONTACT = "contacts are not read: add_contact"
FRICTION = "friction would resist the motion: add_friction"
LIMITS = "limits do not act: add_stop"
FLUID = "a fluid would resist the motion of all bodies"
ROTOR = "a rotor or damper would act along more than one coordinate: add_rotor, add_bushing"
YIELD = "the spring would give way beyond this deflection"
ROPE = "limits of its length do not act: add_rope holds it below the upper one"
HIGHER = "a polynomial of higher order would couple two joints: add_cam"
TENDON = "this tendon would act along its length: add_torque with a function"
_NUMERICS = "settings of the solver"
_SOFT = "loops and couplings are held exactly, without this softness"
_FLEX = "flexible bodies would deform, with forces on the bodies of their vertices"
_CARRIED: Rows = (
    (APPLIED, "body* frame* replicate* attach* composite*", "bodies in bodies; what stands for several is expanded"),
    (APPLIED, "geom*", "where no inertial is given the mass and inertia of a body are those of its geoms"),
    (APPLIED, "joint* freejoint* inertial site*", "the joints that carry the body, its inertia, points on it"),
    (LOOKS, "camera* light* skin*", "not mechanics"),
    (DROPPED, "flexcomp*", _FLEX),
    (DROPPED, "plugin*", "a plugin may move the body"),
)
SERVO = (
    "it would act even at zero control (its armature and damping do): add_drive prescribes motions, add_torque efforts"
)
MOTOR = "it would act when driven (its armature and damping do): add_drive prescribes motions, add_torque efforts"
_MEASURES = (
    "touch accelerometer velocimeter gyro force torque magnetometer camprojection rangefinder jointpos jointvel "
    "tendonpos tendonvel actuatorpos actuatorvel actuatorfrc jointactuatorfrc tendonactuatorfrc ballquat ballangvel "
    "jointlimitpos jointlimitvel jointlimitfrc tendonlimitpos tendonlimitvel tendonlimitfrc framepos framequat "
    "framexaxis frameyaxis framezaxis framelinvel frameangvel framelinacc frameangacc subtreecom subtreelinvel "
    "subtreeangmom insidesite distance normal fromto contact e_potential e_kinetic clock tactile user plugin"
)
ACTUATORS = (
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "orientation",
    "pid",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
    "plugin",
)


def _many(tags: tuple[str, ...]) -> str:
    return " ".join(f"{tag}*" for tag in tags)


_EQUALITY: Rows = (
    (APPLIED, "@active(true)", "one that is not active is reported"),
    (OTHER, "@solref(0.02 1) @solimp(0.9 0.95 0.001 0.5 2)", _SOFT),
)

MJCF = Table(
    "MJCF",
    "mujoco",
    {
        "mujoco": (
            (APPLIED, "@model compiler* option* default* asset* worldbody* include*", "the model"),
            (APPLIED, "tendon* equality* contact*", "springs between two points; loops and couplings"),
            (NO_EFFECT, "size* statistic* custom*", "memory, scales of pictures, data of users"),
            (LOOKS, "visual*", "settings of the renderer"),
            (APPLIED, "actuator* sensor* keyframe* extension* deformable*", "see there"),
        ),
        "compiler": (
            (APPLIED, "@angle(degree) @eulerseq(xyz) @coordinate(local)", "units and order of angles"),
            (
                APPLIED,
                "@inertiafromgeom(auto) @inertiagrouprange(0 5) @settotalmass(-1) @balanceinertia(false)",
                "masses",
            ),
            (APPLIED, "@boundmass(0) @boundinertia(0) @fitaabb(false)", "masses"),
            (
                APPLIED,
                "@fusestatic(false) @alignfree(false)",
                "bodies without joints as one; frames of those that float",
            ),
            (APPLIED, "@meshdir @assetdir @strippath(false)", "folders of files, below that of the model"),
            (LOOKS, "@texturedir", ""),
            (
                NO_EFFECT,
                "@usethread @discardvisual @saveinertial @savecompiled @savecanonical @passthrough @conflict "
                "@autolimits",
                "",
            ),
            (NO_EFFECT, "lengthrange", "of actuators"),
        ),
        "option": (
            (APPLIED, "@gravity", "gravity of the world"),
            (APPLIED, "flag", "see there"),
            (COMPILED, "@density(0) @viscosity(0) @wind(0 0 0)", FLUID),
            (BOUNDS, "@o_margin @o_solref @o_solimp @o_friction", CONTACT),
            (NO_EFFECT, "@actuatorgroupdisable @magnetic", "of actuators and sensors"),
            (
                NO_EFFECT,
                "@timestep @integrator @cone @jacobian @solver @iterations @tolerance @ls_iterations "
                "@ls_tolerance @noslip_iterations @noslip_tolerance @ccd_iterations @ccd_tolerance @sdf_iterations "
                "@sdf_initpoints @impratio @sleep_tolerance @mpr_iterations @mpr_tolerance @apirate @collision",
                _NUMERICS,
            ),
        ),
        "flag": (
            (
                APPLIED,
                "@gravity(enable) @spring(enable) @damper(enable) @passive(enable) @equality(enable) "
                "@constraint(enable)",
                "what is disabled does not act",
            ),
            (
                APPLIED,
                "@limit(enable) @frictionloss(enable) @contact(enable)",
                "what is disabled is not reported as dropped",
            ),
            (
                NO_EFFECT,
                "@actuation @autoreset @clampctrl @diagexact @energy @eulerdamp @filterparent @fwdinv @invdiscrete "
                "@ipc @island @midphase @multiccd @nativeccd @override @refsafe @sensor @sensornoise @sleep "
                "@speculative @warmstart",
                _NUMERICS,
            ),
        ),
        "default": (
            (
                APPLIED,
                "@class default* joint geom site mesh equality=default/equality tendon=spatial",
                "values for others",
            ),
            (
                NO_EFFECT,
                "general motor position velocity intvelocity orientation pid damper cylinder muscle adhesion dcmotor",
                "of actuators",
            ),
            (LOOKS, "material texture camera light", ""),
            (BOUNDS, "pair", CONTACT),
        ),
        "default/equality": _EQUALITY,
        "extension": ((DROPPED, "plugin*", "a plugin may move the model"),),
        "asset": (
            (APPLIED, "mesh* model*", "forms of bodies, whose inertia they give; models that are attached"),
            (LOOKS, "texture* material* skin*", ""),
            (BOUNDS, "hfield*", CONTACT),
        ),
        "mesh": (
            (
                APPLIED,
                "@name @class @file @content_type @scale(1 1 1) @inertia(convex) @vertex @face @builtin "
                "@params @refpos @refquat",
                "inertia of the bodies that have this form",
            ),
            (LOOKS, "@normal @texcoord @smoothnormal @material @maxhullvert", ""),
            (DROPPED, "plugin*", "a plugin may change the form"),
        ),
        "model": (
            (APPLIED, "@file @content_type", "a file of bodies to attach, in the folder of the model"),
            (NO_EFFECT, "@name", ""),
        ),
        "worldbody": (
            (NO_EFFECT, "@name", ""),
            *_CARRIED,
        ),
        "body": (
            (APPLIED, f"@name @childclass @pos {_TURN} @fuse", "where it is drawn"),
            (COMPILED, "@gravcomp(0)", "1 holds the body against gravity; gravity cannot act in part"),
            (OTHER, "@mocap(false)", "a body that is moved by the user stands still: add_drive"),
            (NO_EFFECT, "@simple @sleep @user", ""),
            *_CARRIED,
        ),
        "frame": (
            (APPLIED, f"@childclass @pos {_TURN}", "moves what is inside"),
            (NO_EFFECT, "@name", ""),
            *_CARRIED,
        ),
        "replicate": (
            (APPLIED, "@count @offset @euler @sep", "what is inside, several times"),
            *_CARRIED,
        ),
        "attach": ((APPLIED, "@model @body @frame @prefix", "a part of another model"),),
        "inertial": (
            (APPLIED, f"@pos {_TURN} @mass @diaginertia @fullinertia", "mass, centre of mass, inertia about it"),
        ),
        "joint": (
            (APPLIED, "@name @class @type(hinge) @pos(0 0 0) @axis(0 0 1)", "a joint of the body, on its parent"),
            (
                APPLIED,
                "@stiffness(0) @damping(0) @springref(0) @springdamper(0 0) @armature(0)",
                "a spring, a damper and a rotor along the coordinate",
            ),
            (OTHER, "@ref(0)", "the coordinate is zero as drawn, where MuJoCo gives it this value"),
            (COMPILED, "@frictionloss(0)", FRICTION),
            (COMPILED, "@springyield(0)", YIELD),
            (COMPILED, "@range @limited(auto)", LIMITS),
            (BOUNDS, "@margin(0) @solreflimit @solimplimit", LIMITS),
            (
                BOUNDS,
                "@actuatorfrcrange @actuatorfrclimited @actuatorgravcomp(false)",
                "bounds of actuators do not act",
            ),
            (OTHER, "@solreffriction @solimpfriction", _SOFT),
            (NO_EFFECT, "@group @user", ""),
        ),
        "freejoint": (
            (APPLIED, "@name @align", "a body that floats"),
            (NO_EFFECT, "@group", ""),
        ),
        "geom": (
            (
                APPLIED,
                f"@class @type(sphere) @pos {_TURN} @fromto @size @mass @density @mesh @fitscale @shellinertia(false)",
                "mass and inertia of the body where it has no inertial",
            ),
            (
                BOUNDS,
                "@contype @conaffinity @condim @priority @friction @solmix @solref @solimp @margin @gap @adhesion "
                "@surfacevel @hfield",
                CONTACT,
            ),
            (DROPPED, "@fluidshape(none) @fluidcoef", "a fluid would resist the motion of the body"),
            (LOOKS, "@material @rgba @castshadow @group", "the group counts by inertiagrouprange too"),
            (NO_EFFECT, "@name @user", ""),
            (DROPPED, "plugin*", "a plugin may change the form"),
        ),
        "site": (
            (APPLIED, f"@name @class @pos {_TURN} @fromto", "a point of a body, where tendons and loops may end"),
            (LOOKS, "@type @size @mesh @material @rgba @group", ""),
            (NO_EFFECT, "@user", ""),
        ),
        "deformable": (
            (DROPPED, "flex*", _FLEX),
            (LOOKS, "skin*", ""),
        ),
        "contact": (
            (BOUNDS, "pair*", CONTACT),
            (NO_EFFECT, "exclude*", "contacts are not read"),
        ),
        "tendon": ((APPLIED, "spatial* fixed*", "between two sites a spring; others are reported"),),
        "spatial": (
            (
                APPLIED,
                "@name @class @stiffness @damping @springlength site*=spatial/site",
                "see tendon",
            ),
            (DROPPED, "geom*=whole pulley*=whole", "the tendon would wrap around this, or be multiplied"),
            (COMPILED, "@frictionloss(0)", FRICTION),
            (COMPILED, "@armature(0)", "the inertia along the tendon would add to the mass matrix"),
            (COMPILED, "@springyield(0)", YIELD),
            (COMPILED, "@range @limited(auto)", ROPE),
            (BOUNDS, "@margin(0) @solreflimit @solimplimit", ROPE),
            (BOUNDS, "@actuatorfrcrange @actuatorfrclimited", "bounds of actuators do not act"),
            (OTHER, "@solreffriction @solimpfriction", _SOFT),
            (LOOKS, "@width @material @rgba @group", ""),
            (NO_EFFECT, "@user", ""),
        ),
        "spatial/site": ((APPLIED, "@site", "an end, or a point on the way"),),
        "fixed": (
            (COMPILED, "@name @class @stiffness @damping @springlength joint*=fixed/joint", TENDON),
            (COMPILED, "@frictionloss(0) @armature(0) @springyield(0) @range @limited", "see spatial"),
            (BOUNDS, "@margin(0) @solreflimit @solimplimit", ROPE),
            (BOUNDS, "@actuatorfrcrange @actuatorfrclimited", "bounds of actuators do not act"),
            (OTHER, "@solreffriction @solimpfriction", _SOFT),
            (NO_EFFECT, "@group @user", ""),
        ),
        "fixed/joint": ((COMPILED, "@joint @coef", "see fixed"),),
        "equality": (
            (
                APPLIED,
                "connect* weld* joint*=equality/joint",
                "a common point, two of which are a hinge; a weld; a coupler",
            ),
            (
                COMPILED,
                "tendon*=whole flex* flexvert* flexstrain*",
                "tendons or flexible bodies would depend on each other",
            ),
        ),
        "connect": ((APPLIED, "@name @class @body1 @body2 @anchor @site1 @site2", "a common point"), *_EQUALITY),
        "weld": (
            (APPLIED, "@name @class @body1 @body2 @anchor @relpose @site1 @site2", "a weld"),
            (OTHER, "@torquescale(1)", _SOFT),
            *_EQUALITY,
        ),
        "equality/joint": (
            (
                APPLIED,
                "@name @class @joint1 @joint2 @polycoef",
                "a coupler, where the polynomial is of first order; others are reported",
            ),
            *_EQUALITY,
        ),
        "actuator": (
            (
                COMPILED,
                " ".join(f"{tag}*=whole" for tag in ACTUATORS),
                "acts when driven, and where its law has a bias at zero control too; its armature and damping act, and "
                "the K^2/R of a plain dcmotor",
            ),
        ),
        "sensor": ((OTHER, _many(tuple(_MEASURES.split())), "measures, and moves nothing: add_sensor"),),
        "keyframe": ((OTHER, "key*", "a state that is stored: assemble(targets=...)"),),
    },
)
