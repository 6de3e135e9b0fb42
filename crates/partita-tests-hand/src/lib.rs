//! Tests of reduction and marching, on equations written by hand.
#![cfg(test)]

mod by_hand;
#[path = "../../partita-tests/src/counting/mod.rs"]
mod counting;
mod instants;
mod pieces;
mod problems;

mod marching;
mod reducing;
