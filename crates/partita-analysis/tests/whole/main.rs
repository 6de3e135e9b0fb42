//! Tests of whole mechanisms, in one program: what is generic over mechanisms is compiled for them once.

#[path = "../../../partita-integrate/tests/counting/mod.rs"]
mod counting;
#[path = "../families/mod.rs"]
mod families;
#[path = "../linkages/mod.rs"]
mod linkages;
#[path = "../mechanisms/mod.rs"]
mod mechanisms;
#[path = "../planar/mod.rs"]
mod planar;

#[path = "../closing/mod.rs"]
mod closing;
#[path = "../motion/mod.rs"]
mod motion;
