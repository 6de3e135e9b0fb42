"""What becomes of each prim, schema, attribute and relationship of USD physics.

The attributes of a prim are its own, and `name`, and each schema that is applied to it. Its children are prims; one of
a type that says nothing of mechanics is a `Prim`.
"""

from __future__ import annotations

from .format_table import APPLIED, BOUNDS, COMPILED, DROPPED, LOOKS, NO_EFFECT, OTHER, Table

AXES = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")
"""Axes of a joint whose free directions are chosen: its slides, then its rotations."""
KINDS = ("Revolute", "Prismatic", "Spherical", "Distance", "")
"""Types of joints with attributes of their own; the last is that whose free directions are chosen."""
LIMITS = "limits do not act: add_stop"
CONTACT = "contacts are not read: add_contact"
ACCELERATION = "a drive would give an acceleration, whatever the inertia that it moves: add_torque with a function"
FLUID = "a fluid would resist the motion of all bodies"
FORCE = "a bound of the drive's effort does not act"
FRICTION = "friction would resist the motion: add_friction"
PARTLY = "gravity acts on a body fully or not at all"
NO_MASS = (
    "a mass of 0 says nothing in USD, so its volume counts with its density; where a shape without mass is meant, as "
    "converters from MJCF write it: give the body its mass"
)
SHELL = "the mass would lie in the surface of this shape; it fills its volume"
WELDED = "{} is given, so it has none; it is welded to a body that moves, and other programs may give it 1 kg"
VELOCITY = "the body would start with this velocity: assemble(rates=...) gives a state one"
OWN = "partita"
"""Namespace of attributes that hold in double precision what USD has in single."""

_OTHERS = "an attribute of Newton or MuJoCo that is not known here: the motion may depend on it"
_ACTUATOR = "an actuator, which acts when driven, or by itself where its law has a bias"
_BREAKS = "the joint would break under this load"
_EXACT = "couplings and loops are held exactly, without this softness"
_SOLVER = "settings of a solver"
_SHAPE = "mass and inertia of a body that gives none; drawn"


def _named(form: str, names: tuple[str, ...] = AXES) -> str:
    """Items for each instance of a schema."""
    return " ".join(form.format(name) for name in names)


_PRIMS = (
    (APPLIED, "Xform*=prim Scope*=prim Prim*=prim", "prims in prims, which they move"),
    (APPLIED, "Cube* Sphere* Cylinder* Capsule* Cone* Plane* Mesh*", _SHAPE),
    (APPLIED, "PhysicsScene*", "gravity"),
    (
        APPLIED,
        "PhysicsFixedJoint*=joint PhysicsRevoluteJoint* PhysicsPrismaticJoint* PhysicsSphericalJoint* "
        "PhysicsDistanceJoint* PhysicsJoint*",
        "joints, which may close loops",
    ),
    (NO_EFFECT, "PhysicsCollisionGroup*=group", "contacts are not read"),
    (APPLIED, "Material*", "density of shapes"),
    (COMPILED, "NewtonActuator* MjcActuator*", _ACTUATOR),
    (COMPILED, "MjcTendon*", "a tendon, which is reported by what it does"),
    (OTHER, "MjcKeyframe*", "a state that is stored: assemble(targets=...)"),
)
_XFORM = (
    (APPLIED, "@name @xformOp: @xformOpOrder", "where it is"),
    (
        LOOKS,
        "@visibility @purpose @primvars: @material: @extent @extentsHint @doubleSided @orientation @inputs: @outputs: "
        "@info: @subsetFamily:",
        "",
    ),
    (APPLIED, f"@{OWN}:name", "of files that Partita writes: a name that USD cannot have"),
    (NO_EFFECT, "@proxyPrim @userProperties: @ui: @kind @collection: @model:", ""),
    (DROPPED, "@newton: @mjc:", _OTHERS),
    (LOOKS, "@MjcImageableAPI @MjcSiteAPI @NewtonSiteAPI @mjc:group", ""),
)
_RIGID = (
    (APPLIED, "@PhysicsRigidBodyAPI @physics:rigidBodyEnabled", "a body, unless it is disabled"),
    (
        COMPILED,
        "@physics:kinematicEnabled",
        "a body that is moved by the user is a part of the ground: add_drive",
    ),
    (COMPILED, "@physics:velocity @physics:angularVelocity", VELOCITY),
    (DROPPED, "@physics:startsAsleep(false)", "the body would stand still until something touches it"),
    (NO_EFFECT, "@physics:simulationOwner", "the scene that it belongs to"),
    (
        APPLIED,
        "@PhysicsMassAPI @physics:mass @physics:density(0) @physics:centerOfMass @physics:diagonalInertia "
        "@physics:principalAxes",
        "mass, centre of mass and inertia; what is not given follows from the shapes",
    ),
    (
        NO_EFFECT,
        "@PhysicsArticulationRootAPI @PhysxArticulationAPI @physxArticulation:articulationEnabled",
        "loops are found whatever belongs to an articulation",
    ),
    (COMPILED, "@PhysicsCollisionAPI @physics:collisionEnabled", CONTACT),
    (APPLIED, "@PhysicsMeshCollisionAPI @physics:approximation(none)", "the form whose volume gives the mass"),
    (NO_EFFECT, "@PhysicsFilteredPairsAPI @physics:filteredPairs", "contacts are not read"),
    (APPLIED, "@PhysxRigidBodyAPI @physxRigidBody:disableGravity(false)", "whether gravity acts on it"),
    (
        DROPPED,
        "@physxRigidBody:linearDamping(0) @physxRigidBody:angularDamping(0)",
        "its motion would be damped: add_bushing to the ground",
    ),
    (DROPPED, "@physxRigidBody:lockedPosAxis(0) @physxRigidBody:lockedRotAxis(0)", "these directions would be locked"),
    (
        BOUNDS,
        "@physxRigidBody:maxLinearVelocity @physxRigidBody:maxAngularVelocity @physxRigidBody:maxDepenetrationVelocity "
        "@physxRigidBody:maxContactImpulse @physxRigidBody:contactSlopCoefficient",
        "bounds of speeds and impulses do not act",
    ),
    (
        DROPPED,
        "@physxRigidBody:enableGyroscopicForces(true)",
        "gyroscopic torques would be left out; they act",
    ),
    (
        NO_EFFECT,
        "@physxRigidBody:cfmScale @physxRigidBody:enableCCD @physxRigidBody:enableSpeculativeCCD "
        "@physxRigidBody:retainAccelerations @physxRigidBody:sleepThreshold @physxRigidBody:solveContact "
        "@physxRigidBody:solverPositionIterationCount @physxRigidBody:solverVelocityIterationCount "
        "@physxRigidBody:stabilizationThreshold",
        _SOLVER,
    ),
    (
        NO_EFFECT,
        "@physxArticulation:solverPositionIterationCount @physxArticulation:solverVelocityIterationCount "
        "@physxArticulation:sleepThreshold @physxArticulation:stabilizationThreshold",
        _SOLVER,
    ),
    (BOUNDS, "@physxArticulation:enabledSelfCollisions(false)", CONTACT),
    (APPLIED, "@newton:inertia", "the inertia, before that by moments and axes"),
    (NO_EFFECT, "@NewtonMassAPI", "its attributes count"),
    (COMPILED, "@newton:massModel(solid) @mjc:shellinertia(false)", SHELL),
    (NO_EFFECT, "@newton:shellThickness", "see newton:massModel"),
    (COMPILED, "@mjc:body:gravcomp(0)", PARTLY),
    (NO_EFFECT, "@NewtonArticulationRootAPI @newton:selfCollisionEnabled", "contacts are not read"),
    (APPLIED, "@newton:jointsAddMobility(false)", "joints between the same two bodies are one after the other"),
    (
        NO_EFFECT,
        "@NewtonCollisionAPI @NewtonMeshCollisionAPI @NewtonSDFCollisionAPI @newton:contactMargin @newton:contactGap "
        "@newton:maxHullVertices @newton:sdfMaxResolution @newton:sdfTargetVoxelSize @newton:sdfNarrowBandInner "
        "@newton:sdfNarrowBandOuter @newton:sdfTextureFormat @newton:sdfPadding @newton:hydroelasticEnabled "
        "@newton:hydroelasticStiffness @MjcCollisionAPI @MjcMeshCollisionAPI @mjc:condim @mjc:gap @mjc:margin "
        "@mjc:priority @mjc:solimp @mjc:solmix @mjc:solref @mjc:maxhullvert",
        "contacts are not read, which a remark on the shape says",
    ),
    (DROPPED, "@mjc:inertia(legacy|convex|exact)", "the inertia of the mesh would be computed otherwise"),
    (BOUNDS, "@PhysxCollisionAPI @physxCollision: @PhysxConvexHullCollisionAPI @physxConvexHullCollision:", CONTACT),
)
_OWN_BODY = (
    (
        APPLIED,
        f"@{OWN}:mass @{OWN}:centerOfMass @{OWN}:inertia",
        "of files that Partita writes, where USD's own agree to single precision",
    ),
)
_JOINT = (
    (APPLIED, "@physics:body0 @physics:body1", "what it joins; nothing is the ground"),
    (
        APPLIED,
        "@physics:localPos0(0 0 0) @physics:localPos1(0 0 0) @physics:localRot0(1 0 0 0) @physics:localRot1(1 0 0 0)",
        "its frame on either side; where they are apart assembly closes the joint",
    ),
    (APPLIED, "@physics:jointEnabled(true)", "one that is disabled is reported, and holds nothing"),
    (NO_EFFECT, "@physics:collisionEnabled", "contacts are not read"),
    (NO_EFFECT, "@physics:excludeFromArticulation", "a joint closes a loop where there is one"),
    (NO_EFFECT, "@PhysicsArticulationRootAPI @PhysxArticulationAPI", "a joint to the ground fixes the base"),
    (NO_EFFECT, "@physxArticulation:articulationEnabled", ""),
    (BOUNDS, "@physxArticulation:enabledSelfCollisions(false)", CONTACT),
    (BOUNDS, "@physics:breakForce(inf) @physics:breakTorque(inf)", _BREAKS),
    (
        APPLIED,
        "@PhysxJointAPI @physxJoint:armature(0) @newton:armature(0) @mjc:armature(0)",
        "a rotor along each coordinate",
    ),
    (NO_EFFECT, "@NewtonJointAPI @MjcJointAPI", "its attributes count"),
    (APPLIED, "@newton:damping(0) @mjc:damping(0)", "a damper along each coordinate, per degree by Newton"),
    (APPLIED, "@mjc:stiffness(0) @mjc:springref(0) @mjc:ref(0)", "a spring along the coordinate"),
    (DROPPED, "@mjc:springdamper(0 0)", "MuJoCo would choose a spring and a damper by time constants"),
    (DROPPED, "@newton:friction(0) @mjc:frictionloss(0)", FRICTION),
    (BOUNDS, "@newton:velocityLimit(inf)", "a bound of the speed does not act"),
    (BOUNDS, "@newton:limitStiffness(-inf) @newton:limitDamping(-inf) @mjc:margin(0)", LIMITS),
    (OTHER, "@mjc:solreflimit(0.02 1) @mjc:solimplimit(0.9 0.95 0.001 0.5 2)", LIMITS),
    (OTHER, "@mjc:solreffriction(0.02 1) @mjc:solimpfriction(0.9 0.95 0.001 0.5 2)", FRICTION),
    (
        BOUNDS,
        "@mjc:actuatorfrclimited(auto) @mjc:actuatorfrcrange:min(0) @mjc:actuatorfrcrange:max(0) "
        "@mjc:actuatorgravcomp(false)",
        "bounds of actuators do not act",
    ),
    (NO_EFFECT, "@MjcEqualityAPI @MjcEqualityConnectAPI @MjcEqualityWeldAPI", "a joint that closes a loop"),
    (OTHER, "@mjc:solref(0.02 1) @mjc:solimp(0.9 0.95 0.001 0.5 2) @mjc:torqueScale(1)", _EXACT),
    (
        APPLIED,
        "@NewtonMimicAPI @MjcEqualityJointAPI @newton:mimicEnabled(true) @newton:mimicJoint @newton:mimicCoef0(0) "
        "@newton:mimicCoef1(1) @mjc:target @mjc:coef0(0) @mjc:coef1(1)",
        "a coupler: coordinate = coefficient 0 + coefficient 1 x that of the other joint; in degrees by Newton",
    ),
    (COMPILED, "@mjc:coef2(0) @mjc:coef3(0) @mjc:coef4(0)", "a polynomial of higher order is reported"),
    (NO_EFFECT, "@NewtonArticulationRootAPI @newton:selfCollisionEnabled", "contacts are not read"),
    (APPLIED, "@newton:jointsAddMobility(false)", "joints between the same two bodies are one after the other"),
    (DROPPED, "@physxJoint:jointFriction(0)", FRICTION),
    (BOUNDS, "@physxJoint:maxJointVelocity(inf)", "a bound of the speed does not act"),
    (NO_EFFECT, "@physxJoint:enableProjection", _SOLVER),
    (
        APPLIED,
        f"@{OWN}:kind @{OWN}:localPos0 @{OWN}:localPos1 @{OWN}:localRot0 @{OWN}:localRot1",
        "of files that Partita writes: the frames, where USD's own agree to single precision, and a kind of joint that "
        "USD does not name",
    ),
)


def _drives(*names: str) -> tuple[tuple[str, str, str], ...]:
    """Rows of what acts along these axes."""
    return (
        (
            APPLIED,
            _named("@PhysicsDriveAPI:{0} @drive:{0}:physics:stiffness(0) @drive:{0}:physics:damping(0)", names),
            "a spring and a damper along the coordinate",
        ),
        (
            APPLIED,
            _named("@drive:{0}:physics:targetPosition(0) @drive:{0}:physics:targetVelocity(0)", names),
            "where the spring is at rest; with the damper, a constant effort",
        ),
        (COMPILED, _named("@drive:{0}:physics:type(force)", names), ACCELERATION),
        (BOUNDS, _named("@drive:{0}:physics:maxForce(inf)", names), FORCE),
        (
            APPLIED,
            _named(f"@{OWN}:{{0}}:stiffness @{OWN}:{{0}}:damping @{OWN}:{{0}}:rest @{OWN}:{{0}}:rotor", names),
            "of files that Partita writes, in SI, where USD's own agree to single precision",
        ),
    )


def _drives_of_balls() -> tuple[tuple[str, str, str], ...]:
    """Rows of drives about axes that are no coordinates."""
    words = "a drive would act about an axis that is not a coordinate of this joint: add_bushing"
    names = ("angular", *AXES[3:])
    keys = ("type", "stiffness", "damping", "targetPosition", "targetVelocity", "maxForce")
    return (
        (DROPPED, _named("@PhysicsDriveAPI:{0}", names), words),
        *((NO_EFFECT, _named(f"@drive:{{0}}:physics:{key}", names), "see there") for key in keys),
    )


def _states(*names: str) -> tuple[tuple[str, str, str], ...]:
    """Rows of what other schemas state of these axes."""
    return (
        (NO_EFFECT, _named("@PhysicsJointStateAPI:{0}", names), ""),
        (
            OTHER,
            _named("@state:{0}:physics:position", names),
            "a state that is stored; the bodies are where they are drawn",
        ),
        (OTHER, _named("@state:{0}:physics:velocity", names), "a state that is stored: assemble(rates=...)"),
        (BOUNDS, _named("@PhysxLimitAPI:{0}", names) + " @physxLimit:", LIMITS),
    )


_MIMIC = tuple(
    row
    for name in AXES[3:]
    for row in (
        (
            APPLIED,
            f"@PhysxMimicJointAPI:{name} @physxMimicJoint:{name}:gearing @physxMimicJoint:{name}:offset "
            f"@physxMimicJoint:{name}:referenceJoint",
            "a coupler: coordinate + gearing x that of the other joint + offset = 0",
        ),
        (
            APPLIED,
            f"@{OWN}:{name}:gearing @{OWN}:{name}:offset @{OWN}:{name}:name",
            "of files that Partita writes, in radians, where USD's own agree to single precision",
        ),
        (NO_EFFECT, f"@physxMimicJoint:{name}:referenceJointAxis", "a joint has one axis"),
        (
            OTHER,
            f"@physxMimicJoint:{name}:naturalFrequency @physxMimicJoint:{name}:dampingRatio",
            _EXACT,
        ),
    )
)
_AXIS = ((APPLIED, "@physics:axis(X)", "its axis, in its frames"),)
_RANGE = ((BOUNDS, "@physics:lowerLimit(-inf) @physics:upperLimit(inf)", LIMITS),)


USD = Table(
    "USD",
    "stage",
    {
        "stage": (
            (APPLIED, "@metersPerUnit @kilogramsPerUnit @upAxis", "units, and the direction that is up"),
            (APPLIED, "@subLayers", "files in the folder of the model or below the root that the caller names"),
            (
                NO_EFFECT,
                "@name @defaultPrim @documentation @comment @customLayerData @timeCodesPerSecond @framesPerSecond "
                "@startTimeCode @endTimeCode @subLayerOffsets @framePrecision @owner @sessionOwner @hasOwnedSubLayers "
                "@colorConfiguration @colorManagementSystem @renderSettingsPrimPath @expressionVariables @primOrder "
                "@primChildren",
                "",
            ),
            *_PRIMS,
        ),
        "any": (*_XFORM, *_PRIMS),
        "prim": (*_RIGID, *_OWN_BODY, (DROPPED, "@prototypes", "what is instanced many times is not read")),
        "Cube": ((APPLIED, "@size(2)", "its edges"),),
        "Sphere": ((APPLIED, "@radius(1)", ""),),
        "Cylinder": ((APPLIED, "@radius(1) @height(2) @axis(Z)", ""),),
        "Capsule": ((APPLIED, "@radius(0.5) @height(1) @axis(Z)", ""),),
        "Cone": ((APPLIED, "@radius(1) @height(2) @axis(Z)", ""),),
        "Plane": ((LOOKS, "@width @length @axis", "it has no volume"),),
        "Mesh": (
            (APPLIED, "@points @faceVertexCounts @faceVertexIndices", "its volume; not drawn"),
            (LOOKS, "@normals @subdivisionScheme", ""),
        ),
        "PhysicsScene": (
            (
                APPLIED,
                "@physics:gravityDirection(0 0 0) @physics:gravityMagnitude(-inf)",
                "gravity; by default that of the earth, 9.81 m/s^2, downwards",
            ),
            (NO_EFFECT, "@PhysxSceneAPI @physxScene:", _SOLVER),
            (APPLIED, "@newton:gravityEnabled(true) @mjc:flag:gravity(true)", "whether gravity acts"),
            (
                NO_EFFECT,
                "@NewtonSceneAPI @NewtonXpbdSceneAPI @NewtonKaminoSceneAPI @NewtonVbdSceneAPI @NewtonMPMSceneAPI "
                "@MjcSceneAPI @newton: @mjc:",
                _SOLVER,
            ),
            (APPLIED, "@mjc:compiler:angle(degree)", "the unit of angles of springs of MuJoCo"),
            (APPLIED, "@mjc:flag:spring(true) @mjc:flag:damper(true) @mjc:flag:equality(true)", "what it disables"),
            (DROPPED, "@mjc:flag:constraint(true)", "without constraints the loops of the file would be open"),
            (DROPPED, "@mjc:option:density(0) @mjc:option:viscosity(0) @mjc:option:wind(0 0 0)", FLUID),
            (
                DROPPED,
                "@mjc:compiler:setTotalMass(-1) @mjc:compiler:balanceInertia(false) @mjc:compiler:boundMass(0) "
                "@mjc:compiler:boundInertia(0) @mjc:compiler:inertiaFromGeom(auto)",
                "the compiler of MuJoCo would change masses",
            ),
            (APPLIED, f"@{OWN}:gravity", "of files that Partita writes, in SI"),
        ),
        "joint": _JOINT,
        "PhysicsRevoluteJoint": (
            *_AXIS,
            *_RANGE,
            *_drives("angular"),
            *_states("angular"),
            *_MIMIC,
        ),
        "PhysicsPrismaticJoint": (*_AXIS, *_RANGE, *_drives("linear"), *_states("linear")),
        "PhysicsSphericalJoint": (
            *_drives_of_balls(),
            (NO_EFFECT, "@physics:axis", "that of the cone"),
            (BOUNDS, "@physics:coneAngle0Limit(-1) @physics:coneAngle1Limit(-1)", LIMITS),
        ),
        "PhysicsDistanceJoint": (
            (COMPILED, "@physics:minDistance(-1) @physics:maxDistance(-1)", "a distance, where both are the same"),
            (APPLIED, f"@{OWN}:length", "of files that Partita writes"),
            (NO_EFFECT, f"@physics:localRot0 @physics:localRot1 @{OWN}:localRot0 @{OWN}:localRot1", "it joins points"),
        ),
        "PhysicsJoint": (
            (
                COMPILED,
                _named("@PhysicsLimitAPI:{0} @limit:{0}:physics:low(-inf) @limit:{0}:physics:high(inf)"),
                "directions whose lower limit is above the upper one, or both 0, are locked",
            ),
            (
                BOUNDS,
                _named("@PhysicsLimitAPI:{0} @limit:{0}:physics:low @limit:{0}:physics:high", ("distance",)),
                LIMITS,
            ),
            *_drives(*AXES),
            *_states(*AXES),
        ),
        "group": (
            (
                NO_EFFECT,
                "@physics:filteredGroups @physics:mergeGroup @physics:invertFilteredGroups",
                "contacts are not read",
            ),
        ),
        "NewtonActuator": (
            (COMPILED, "@newton:kp(0) @newton:kd(0) @newton:ki(0) @newton:constEffort(0)", _ACTUATOR),
            (
                NO_EFFECT,
                "@newton: @NewtonPDControlAPI @NewtonPIDControlAPI @NewtonActuatorControlBaseAPI "
                "@NewtonActuatorClampingBaseAPI @NewtonMaxEffortClampingAPI @NewtonDCMotorClampingAPI "
                "@NewtonPositionBasedClampingAPI @NewtonActuatorDelayAPI",
                "see there",
            ),
            (DROPPED, "@NewtonNeuralControlAPI", "a network would act"),
        ),
        "MjcActuator": (
            (COMPILED, "@mjc:biasType(none)", _ACTUATOR),
            (NO_EFFECT, "@mjc:", "see there"),
        ),
        "MjcTendon": (
            (
                COMPILED,
                "@mjc:stiffness(0) @mjc:damping(0) @mjc:armature(0) @mjc:frictionloss(0) @mjc:range:min(0) "
                "@mjc:range:max(0)",
                "by these it is reported",
            ),
            (NO_EFFECT, "@mjc:", "see there"),
        ),
        "Material": (
            (
                APPLIED,
                "@PhysicsMaterialAPI @physics:density(0)",
                "of shapes that have it, unless they or their body give one",
            ),
            (BOUNDS, "@physics:dynamicFriction @physics:staticFriction @physics:restitution", CONTACT),
            (BOUNDS, "@PhysxMaterialAPI @physxMaterial:", CONTACT),
            (
                NO_EFFECT,
                "@NewtonMaterialAPI @MjcMaterialAPI @NewtonMPMMaterialAPI @newton: @mjc:",
                "contacts are not read",
            ),
        ),
    },
    {
        **dict.fromkeys(
            (
                "prim",
                "joint",
                "PhysicsScene",
                "group",
                "Material",
                "NewtonActuator",
                "MjcActuator",
                "MjcTendon",
            ),
            "any",
        ),
        **dict.fromkeys(("Cube", "Sphere", "Cylinder", "Capsule", "Cone", "Plane", "Mesh"), "prim"),
        **dict.fromkeys((f"Physics{kind}Joint" for kind in KINDS), "joint"),
    },
)
