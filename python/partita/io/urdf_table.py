"""What becomes of each element and attribute of URDF, with the dialects that close loops."""

from __future__ import annotations

from .format_table import APPLIED, BOUNDS, COMPILED, DROPPED, LOOKS, NO_EFFECT, OTHER, REFUSED, Table

_JOINT = "the joint between two links, drawn at zero"
_SIDE = "@xyz(0 0 0) @rpy(0 0 0)"

URDF = Table(
    "URDF",
    "robot",
    {
        "robot": (
            (APPLIED, "@name link* joint*", "the mechanism, its bodies and joints"),
            (APPLIED, "loop* loop_joint*=loop coupling*", "dialects: joints that close loops, and coupled joints"),
            (APPLIED, "fixed_frame*=frame frame*", "dialects: marks on links, of which pairs may close loops"),
            (NO_EFFECT, "@version @xmlns", ""),
            (LOOKS, "material*", "colours"),
            (
                COMPILED,
                "transmission*=whole",
                "motors, of which the rotors alone are read: drake:rotor_inertia, behind "
                "drake:gear_ratio (1), of a SimpleTransmission to a joint whose effort is not 0",
            ),
            (OTHER, "sensor* contact* model_state*", "settings of a simulator"),
            (DROPPED, "gazebo*", "settings of a simulator, which may act there (gravity, springs, motors)"),
            (REFUSED, "xacro:*", "must be expanded first: xacro FILE > robot.urdf"),
        ),
        "link": (
            (APPLIED, "@name inertial", "a body; without inertia it has no mass"),
            (LOOKS, "visual*", "shapes to draw"),
            (OTHER, "@type contact* gazebo* sensor* material*", "settings of a simulator"),
            (BOUNDS, "collision*", "contacts are not read: add_contact"),
        ),
        "visual": (
            (LOOKS, "origin geometry material", "a shape in the link"),
            (NO_EFFECT, "@name", ""),
        ),
        "geometry": ((LOOKS, "box cylinder sphere mesh capsule", "its form; capsules are not drawn, and reported"),),
        "box": ((LOOKS, "@size", ""),),
        "cylinder": ((LOOKS, "@radius @length", ""),),
        "capsule": ((LOOKS, "@radius @length", ""),),
        "sphere": ((LOOKS, "@radius", ""),),
        "mesh": ((LOOKS, "@filename @scale(1 1 1)", "a file in the folder of the model"),),
        "inertial": (
            (APPLIED, "origin mass inertia", "mass, centre of mass, inertia about it in the axes of the origin"),
        ),
        "origin": ((APPLIED, _SIDE, "position and fixed-axis angles (roll, pitch, yaw)"),),
        "mass": ((APPLIED, "@value", "in kg"),),
        "inertia": ((APPLIED, "@ixx(0) @ixy(0) @ixz(0) @iyy(0) @iyz(0) @izz(0)", "in kg m^2"),),
        "joint": (
            (APPLIED, "@name @type origin parent=end child=end axis", _JOINT),
            (APPLIED, "dynamics mimic", "damping; a coupler"),
            (BOUNDS, "limit", "limits do not act: add_stop"),
            (BOUNDS, "safety_controller", "the limits of a controller do not act: add_stop"),
            (APPLIED, "joint_properties", "an old form of <dynamics>; see there"),
            (NO_EFFECT, "calibration", ""),
            (OTHER, "sensor* gazebo* hardwareInterface*", "settings of a simulator"),
        ),
        "joint[fixed]": (
            (NO_EFFECT, "axis dynamics limit safety_controller joint_properties", "a fixed joint has no coordinate"),
        ),
        "joint[continuous]": ((BOUNDS, "limit", "bounds of effort and velocity do not act"),),
        "joint[floating]": (
            (NO_EFFECT, "axis", "a floating joint has no axis"),
            (DROPPED, "dynamics", "damping and friction would resist the motion of all six coordinates"),
        ),
        "joint[spherical]": (
            (NO_EFFECT, "axis", "a spherical joint has no axis"),
            (DROPPED, "dynamics", "damping and friction would resist the rotation: add_bushing"),
        ),
        "joint[planar]": (
            (DROPPED, "dynamics", "damping and friction would resist the motion in the plane: add_bushing"),
        ),
        "end": ((APPLIED, "@link", "the link at this end"),),
        "axis": ((APPLIED, "@xyz", "in the frame of the joint"),),
        "dynamics": (
            (APPLIED, "@damping(0)", "a damper along the coordinate"),
            (
                DROPPED,
                "@friction(0)",
                "friction would resist the motion: add_friction, which needs the stick velocity too",
            ),
        ),
        "joint_properties": (
            (DROPPED, "@damping(0) @friction(0)", "an old form of <dynamics>, which readers of URDF ignore"),
        ),
        "mimic": (
            (APPLIED, "@joint @multiplier(1) @offset(0)", "coordinate = multiplier x that of the joint + offset"),
        ),
        "frame": (
            (APPLIED, "@name @attached_to @link parent=end", "a mark on a link"),
            (APPLIED, f"origin {_SIDE}", "its position and angles in the link"),
        ),
        "loop": (
            (APPLIED, "@name @type(revolute)", "a joint that closes a loop"),
            (APPLIED, "predecessor=side successor=side link1*=side link2=side parent=side child=side", "its two links"),
            (APPLIED, "origin parent_origin=origin child_origin=origin axis", "its frames in them, and its axis"),
            (BOUNDS, "limit", "limits do not act: add_stop"),
            (DROPPED, "dynamics", "damping and friction would resist the motion: add_torsion_spring, add_friction"),
        ),
        "side": ((APPLIED, f"@link origin {_SIDE}", "a link and a frame in it"),),
        "coupling": (
            (APPLIED, "@name predecessor=side successor=side ratio", "the successor's path moves ratio times as far"),
        ),
        "ratio": ((APPLIED, "@value", ""),),
    },
)
