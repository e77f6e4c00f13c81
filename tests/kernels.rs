//! Property and derivative tests of the kernels, one module per room.

#[path = "kernels/ellipsoid.rs"]
mod ellipsoid;
#[path = "kernels/gauss_newton.rs"]
mod gauss_newton;
#[path = "kernels/made_session.rs"]
mod made_session;
#[path = "kernels/norm_invariant.rs"]
mod norm_invariant;
#[path = "kernels/poisson.rs"]
mod poisson;
#[path = "kernels/rotation.rs"]
mod rotation;
#[path = "kernels/session_model.rs"]
mod session_model;
#[path = "kernels/stillness.rs"]
mod stillness;

#[path = "kernels/allan.rs"]
mod allan;
