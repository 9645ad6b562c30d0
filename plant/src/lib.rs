//! The vehicle: six degrees of freedom, actuators, wind, sensors (7)-(22).
