// The WebAssembly module as a function from settings, one `key=value` a line, to the flight.

export async function load(bytes) {
  const { instance } = await WebAssembly.instantiate(bytes, {}); // the module imports nothing
  const { memory, trefoil_settings, trefoil_fly, trefoil_answer } = instance.exports;
  const bytesAt = (address, length) => new Uint8Array(memory.buffer, address, length);
  return settings => {
    const text = new TextEncoder().encode(settings);
    bytesAt(trefoil_settings(text.length), text.length).set(text);
    const length = trefoil_fly();
    return JSON.parse(new TextDecoder().decode(bytesAt(trefoil_answer(), length)));
  };
}
