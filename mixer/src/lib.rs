//! Control allocation: forces and moments to rotor speeds and tilt (31)-(44).
