//! Tests of reduction and marching, on user-defined equations.
#![cfg(test)]

#[path = "../../partita-tests/src/counting/mod.rs"]
mod counting;
mod instants;
mod pieces;
mod problems;
mod user_system;

mod marching;
mod reducing;
