//! Tests of whole mechanisms, in one program: what is generic over number types is compiled for them once.
#![cfg(test)]

mod counting;
mod families;
mod linkages;
mod mechanisms;
mod planar;

mod closing;
mod motion;
