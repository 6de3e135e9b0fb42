"""What becomes of each element and attribute of SDFormat, versions 1.4 to 1.12."""

from __future__ import annotations

from .format_table import APPLIED, BOUNDS, COMPILED, DROPPED, LOOKS, NO_EFFECT, OTHER, REFUSED, Table

VERSIONS = tuple(f"1.{minor}" for minor in range(3, 13))
"""Versions that are read; 1.3 differs from 1.4 in settings of solvers alone."""

_POSE = (
    (APPLIED, "#(0 0 0 0 0 0)", "position and fixed-axis angles (roll, pitch, yaw)"),
    (APPLIED, "@frame[1.5-1.6] @relative_to[1.7-]", "the frame in which it is given"),
    (
        APPLIED,
        "@rotation_format(euler_rpy)[1.9-] @degrees(false)[1.9-]",
        "angles in degrees, or a quaternion x, y, z, w",
    ),
)
_TEXT = ((APPLIED, "#", "its value"),)
_LEAF = ((LOOKS, "#", ""),)
_ADDED = [f"{a}{b}" for i, a in enumerate("xyzpqr") for b in "xyzpqr"[i:]]
_NUMERICS = "settings of a solver, which close loops softly"

_ROTOR = "drake:rotor_inertia drake:gear_ratio"
_NO_MOTOR = (NO_EFFECT, _ROTOR, "Drake has motors on joints of one axis alone")

SDF = Table(
    "SDFormat",
    "sdf",
    {
        "sdf": (
            (APPLIED, "@version world* model*", "its rules; models, alone or in one world"),
            (LOOKS, "light* actor*", "not mechanics"),
        ),
        "world": (
            (APPLIED, "model* gravity", "models; gravity, in its absence 9.8 m/s^2 along -z"),
            (APPLIED, "include* joint* frame*[1.7-]", "models of other files; joints and frames between models"),
            (APPLIED, "physics*[-1.5]", "up to 1.5 gravity stands here"),
            (NO_EFFECT, "physics*[1.6-]", _NUMERICS),
            (LOOKS, "@name", "names the mechanism, where there are several models"),
            (NO_EFFECT, "@default_physics", ""),
            (APPLIED, "wind[1.6-]", "see there"),
            (DROPPED, "state* population*", "it would move models, or add some"),
            (LOOKS, "light* gui scene* road* actor* audio", "not mechanics"),
            (NO_EFFECT, "magnetic_field[1.6-] atmosphere[1.6-] spherical_coordinates", "for sensors"),
            (BOUNDS, "plugin*", "a plugin may drive the model"),
        ),
        "wind": ((DROPPED, "linear_velocity(0 0 0)", "wind would push bodies that enable it: add_force"),),
        "physics": (
            (APPLIED, "gravity[-1.5]", "gravity of the world, by default 9.8 m/s^2 along -z"),
            (
                NO_EFFECT,
                "@name @default @type @default_physics max_step_size real_time_factor real_time_update_rate",
                "",
            ),
            (NO_EFFECT, "max_contacts dart simbody bullet ode", _NUMERICS),
            (NO_EFFECT, "magnetic_field[1.5-1.5] update_rate[-1.3]", ""),
        ),
        "gravity": ((APPLIED, "#", "in m/s^2"),),
        "model": (
            (
                APPLIED,
                "@name link* joint* frame*[1.5-]",
                "the mechanism, its bodies, joints and frames; closing_NAME_1 and _2 close loops",
            ),
            (APPLIED, "pose static(false)", "where it stands, with its rotation; whether its links are the ground"),
            (
                APPLIED,
                "@canonical_link[1.7-] @placement_frame[1.8-]",
                "the link of its frame; the frame that is placed",
            ),
            (APPLIED, "model*[1.5-] include*[1.5-]", "nested models, and those of other files"),
            (NO_EFFECT, "allow_auto_disable @namespace[1.11-]", ""),
            (BOUNDS, "self_collide(false)", "contacts are not read: add_contact"),
            (DROPPED, "enable_wind(false)[1.6-]", "wind would push its links: add_force"),
            (BOUNDS, "plugin*", "a plugin may drive the model"),
            (BOUNDS, "gripper*", "a gripper would hold what it touches"),
        ),
        "include": (
            (
                APPLIED,
                "uri name pose static",
                "a file in the folder of the model or below the root that the caller names",
            ),
            (
                APPLIED,
                "placement_frame[1.8-] @merge(false)[1.9-]",
                "the frame that is placed; without a name of its own",
            ),
            (NO_EFFECT, "namespace[1.11-]", ""),
            (BOUNDS, "plugin*", "a plugin may drive the model"),
        ),
        "uri": _TEXT,
        "name": _TEXT,
        "placement_frame": _TEXT,
        "frame": ((APPLIED, "@name pose @attached_to[1.7-]", "a frame, in the model or attached to another one"),),
        "pose": _POSE,
        "static": _TEXT,
        "link": (
            (APPLIED, "@name pose inertial", "a body, by default of 1 kg and 1 kg m^2"),
            (APPLIED, "gravity=flag(true)", "whether gravity acts on it"),
            (LOOKS, "visual* light*[1.6-] particle_emitter*[1.6-] projector*", "shapes to draw, lights"),
            (BOUNDS, "collision* self_collide(false)", "contacts are not read: add_contact"),
            (DROPPED, "kinematic(false)", "forces would not move it: add_drive"),
            (APPLIED, "velocity_decay", "see there"),
            (DROPPED, "enable_wind(false)[1.6-]", "wind would push it: add_force"),
            (NO_EFFECT, "must_be_base_link audio_sink* audio_source* battery*[1.5-]", ""),
            (OTHER, "sensor*", "measures, and moves nothing: add_sensor"),
        ),
        "flag": _TEXT,
        "velocity_decay": ((DROPPED, "linear(0) angular(0)", "its motion would be damped: add_bushing to the ground"),),
        "fluid_added_mass": (
            (DROPPED, " ".join(f"{entry}(0)" for entry in _ADDED), "the mass of a fluid would move with the link"),
        ),
        "inertial": (
            (
                APPLIED,
                "pose=inertial/pose mass inertia",
                "mass, centre of mass, inertia about it in the axes of the pose",
            ),
            (REFUSED, "@auto(false)[1.11-]", "asks for masses from collision shapes; write <mass> and <inertia>"),
            (NO_EFFECT, "density[1.11-] auto_inertia_params[1.11-]", "where masses come from collision shapes"),
            (APPLIED, "fluid_added_mass[1.10-]", "see there"),
        ),
        "inertial/pose": _POSE[::2],
        "mass": _TEXT,
        "inertia": ((APPLIED, "ixx(1) ixy(0) ixz(0) iyy(1) iyz(0) izz(1)", "in kg m^2"),),
        **{f"i{a}": _TEXT for a in ("xx", "xy", "xz", "yy", "yz", "zz")},
        "joint": (
            (APPLIED, "@name @type parent child pose", "a joint between two links, drawn at zero; it may close a loop"),
            (APPLIED, "axis", "its axis"),
            (OTHER, "axis2=axis", "joints of this type have one axis"),
            (
                NO_EFFECT,
                "gearbox_ratio gearbox_reference_body thread_pitch screw_thread_pitch[1.10-]",
                "of other types",
            ),
            (APPLIED, "drake:rotor_inertia=value drake:gear_ratio=value(1)", "the rotor of a motor, as Drake reads it"),
            (OTHER, "physics", _NUMERICS),
            (OTHER, "sensor*", "measures, and moves nothing: add_sensor"),
        ),
        "joint[screw]": (
            (APPLIED, "thread_pitch screw_thread_pitch[1.10-]", "advance per turn"),
            (DROPPED, _ROTOR, "a rotor would turn with the joint: add_rotor"),
        ),
        "joint[universal]": ((APPLIED, "axis2=axis", "its second axis"), _NO_MOTOR),
        "joint[fixed]": ((NO_EFFECT, "axis axis2", "a fixed joint has no axis"), _NO_MOTOR),
        "joint[ball]": (
            (COMPILED, "axis=ball/axis", "laws about all axes: dampers and springs, which are reported"),
            (OTHER, "axis2", "a ball joint has no second axis"),
            _NO_MOTOR,
        ),
        "ball/axis": (
            (COMPILED, "dynamics", "a damper about all axes, which is reported"),
            (NO_EFFECT, "xyz use_parent_model_frame[1.5-1.6] initial_position[1.6-1.8]", "it has no axis"),
            (BOUNDS, "limit", "limits do not act: add_stop"),
            (DROPPED, "mimic[1.11-]", "it would follow another joint"),
        ),
        "joint[gearbox]": (
            (APPLIED, "gearbox_ratio(1) gearbox_reference_body", "hinges on this link that turn -ratio : 1"),
            (APPLIED, "axis=gearbox/axis axis2=gearbox/axis", "the axes of the hinges of its parent and its child"),
            _NO_MOTOR,
        ),
        "gearbox/axis": (
            (APPLIED, "xyz(0 0 1) use_parent_model_frame(false)[1.5-1.6]", "its direction"),
            (DROPPED, "dynamics mimic[1.11-]", "laws of a gearbox would act: give them to its hinges"),
            (BOUNDS, "limit", "limits do not act: add_stop"),
        ),
        "gearbox_ratio": _TEXT,
        "gearbox_reference_body": _TEXT,
        "parent": _TEXT,
        "child": _TEXT,
        "thread_pitch": _TEXT,
        "screw_thread_pitch": _TEXT,
        "axis": (
            (APPLIED, "xyz(0 0 1) dynamics mimic[1.11-]", "its direction, spring and damper; a coupler"),
            (
                APPLIED,
                "use_parent_model_frame(false)[1.5-1.6]",
                "whether the axis is in the frame of the model; in 1.4 it is",
            ),
            (BOUNDS, "limit", "limits do not act: add_stop"),
            (DROPPED, "initial_position(0)[1.6-1.8]", "the joint would start there: assemble(targets=...)"),
        ),
        "xyz": (
            (APPLIED, "#(0 0 1)", "in the frame of the joint"),
            (APPLIED, "@expressed_in[1.7-]", "or in this frame"),
        ),
        "use_parent_model_frame": _TEXT,
        "dynamics": (
            (APPLIED, "damping=value(0)", "a damper along the coordinate"),
            (
                APPLIED,
                "spring_stiffness=value(0)[1.5-] spring_reference=value(0)[1.5-]",
                "a spring along the coordinate",
            ),
            (
                DROPPED,
                "friction(0)",
                "friction would resist the motion: add_friction, which needs the stick velocity too",
            ),
        ),
        "value": _TEXT,
        "mimic": (
            (APPLIED, "@joint", "the joint that it follows"),
            (
                APPLIED,
                "@axis(axis) multiplier=value(1) offset=value(0) reference=value(0)",
                "coordinate = multiplier x (that of the joint - reference) + offset",
            ),
        ),
        "visual": (
            (LOOKS, "pose geometry material", "a shape in the link"),
            (LOOKS, "@name cast_shadows laser_retro transparency visibility_flags meta plugin*", "not drawn"),
        ),
        "geometry": (
            (LOOKS, "box cylinder sphere mesh", "its form"),
            (
                LOOKS,
                "empty capsule[1.8-] ellipsoid[1.8-] cone[1.11-] plane image heightmap polyline*",
                "not drawn, and reported",
            ),
        ),
        "box": ((LOOKS, "size=looks", ""),),
        "cylinder": ((LOOKS, "radius=looks length=looks", ""),),
        "sphere": ((LOOKS, "radius=looks", ""),),
        "mesh": (
            (LOOKS, "uri=looks scale=looks(1 1 1)", "a file in the folder of the model"),
            (LOOKS, "submesh @optimization[1.11-] convex_decomposition[1.11-]", "not drawn alone"),
        ),
        "looks": _LEAF,
    },
)
