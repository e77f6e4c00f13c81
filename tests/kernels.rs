//! Property and derivative tests of the kernels, one module per room.

#[path = "kernels/rotation.rs"]
mod rotation;
