//! Position PID: trajectory to attitude and climb references (45)-(47).
