//! Functions of FMI 3.0 for other kinds of FMU and for types that no variable has. The standard requires all of them;
//! each returns an error.
//!
//! These functions read none of their arguments, so they are declared without arguments: in the calling conventions of
//! the platforms of this FMU the caller alone places and removes arguments.

#![expect(unsafe_code, reason = "the functions are exported to C")]

use std::ffi::c_void;

use crate::exports::{ERROR, Status};

macro_rules! absent {
    ($($name:ident)*) => {
        $(
            // SAFETY: the standard has one function of this name in an FMU.
            #[unsafe(no_mangle)]
            pub extern "C" fn $name() -> Status {
                ERROR
            }
        )*
    };
}

absent! {
    fmi3EnterEventMode fmi3GetFloat32 fmi3GetInt8 fmi3GetUInt8 fmi3GetInt16 fmi3GetUInt16 fmi3GetInt32 fmi3GetUInt32
    fmi3GetInt64 fmi3GetUInt64 fmi3GetBoolean fmi3GetBinary fmi3GetClock fmi3SetFloat32 fmi3SetInt8 fmi3SetUInt8
    fmi3SetInt16 fmi3SetUInt16 fmi3SetInt32 fmi3SetUInt32 fmi3SetInt64 fmi3SetUInt64 fmi3SetBoolean fmi3SetBinary
    fmi3SetClock fmi3GetNumberOfVariableDependencies fmi3GetVariableDependencies fmi3GetDirectionalDerivative
    fmi3GetAdjointDerivative fmi3EnterConfigurationMode fmi3ExitConfigurationMode fmi3GetIntervalDecimal
    fmi3GetIntervalFraction fmi3GetShiftDecimal fmi3GetShiftFraction fmi3SetIntervalDecimal fmi3SetIntervalFraction
    fmi3SetShiftDecimal fmi3SetShiftFraction fmi3EvaluateDiscreteStates fmi3UpdateDiscreteStates
    fmi3EnterContinuousTimeMode fmi3CompletedIntegratorStep fmi3SetTime fmi3SetContinuousStates
    fmi3GetContinuousStateDerivatives fmi3GetEventIndicators fmi3GetContinuousStates fmi3GetNominalsOfContinuousStates
    fmi3GetNumberOfEventIndicators fmi3GetNumberOfContinuousStates fmi3EnterStepMode fmi3GetOutputDerivatives
    fmi3ActivateModelPartition
}

/// Returns NULL: this FMU is for co-simulation only.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3InstantiateModelExchange() -> *mut c_void {
    std::ptr::null_mut()
}

/// Returns NULL: this FMU is for co-simulation only.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3InstantiateScheduledExecution() -> *mut c_void {
    std::ptr::null_mut()
}
