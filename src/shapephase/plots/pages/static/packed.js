// What Python wrote into the page: JSON, whose arrays stand together in one compressed block.
"use strict";

const ARRAY_KINDS = {float32: Float32Array, float64: Float64Array, uint32: Uint32Array};

async function unpackedData() {
  const packed = Uint8Array.from(atob(document.getElementById("arrays").textContent.trim()), c => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = await new Response(stream).arrayBuffer();
  return JSON.parse(document.getElementById("data").textContent, (key, value) => {
    if (value === null || typeof value !== "object" || !("array_kind" in value)) return value;
    return new ARRAY_KINDS[value.array_kind](bytes, value.start, value.length);
  });
}

// Row k of an array of rows.
function row(array, k, width) {
  return array.subarray(k * width, (k + 1) * width);
}
