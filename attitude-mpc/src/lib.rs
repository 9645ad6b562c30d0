//! Linear MPC of attitude and vertical velocity (1)-(6), (48)-(53).
