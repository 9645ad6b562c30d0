//! Functions that every interface of a library offers.

/// Node of a library behind its interface. Errors are the reason in words.
pub trait Engine {
    /// Answers to one sample; `input` and `answer` have the types of the node in `trefoil.h`.
    fn step(&mut self, input: &[u8], answer: &mut [u8]) -> Result<(), String>;
    /// Size of the memory \[byte\]; 0 if the node keeps none.
    fn memory_bytes(&self) -> usize;
    /// Writes the memory to `memory`, of [`memory_bytes`](Self::memory_bytes).
    fn snapshot(&self, memory: &mut [u8]);
    /// Continues from `memory`, of [`memory_bytes`](Self::memory_bytes); returns `false` if the node refuses it.
    fn restore(&mut self, memory: &[u8]) -> bool;
}
