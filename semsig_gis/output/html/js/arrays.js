// Unpacked arrays, by their packed form: several layers may share one.
semsig.unpacked = new WeakMap();
semsig.arrays = async (packed) => {
  const kinds = {
    u1: Uint8Array, u2: Uint16Array, i4: Int32Array, f8: Float64Array,
  };
  const read = async ([kind, text]) => {
    const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const response = new Response(stream);
    if (kind === "json") return response.json();
    if (kind !== "steps") return new kinds[kind](await response.arrayBuffer());
    // Four planes with the bytes of all numbers; the numbers are differences, to be summed up.
    const planes = new Uint8Array(await response.arrayBuffer());
    const values = new Int32Array(planes.length / 4);
    const size = values.length;
    for (let at = 0, sum = 0; at < size; at += 1) {
      sum += planes[at] | planes[at + size] << 8 | planes[at + 2 * size] << 16
        | planes[at + 3 * size] << 24;
      values[at] = sum;
    }
    return values;
  };
  const names = Object.keys(packed);
  const once = (entry) => {
    if (!semsig.unpacked.has(entry)) semsig.unpacked.set(entry, read(entry));
    return semsig.unpacked.get(entry);
  };
  const arrays = await Promise.all(names.map((name) => once(packed[name])));
  return Object.fromEntries(names.map((name, at) => [name, arrays[at]]));
};
