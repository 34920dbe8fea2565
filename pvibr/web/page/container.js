// Reads the scene of the page: its tree, with typed arrays and ImageBitmaps for its leaves.
// The page's data blocks hold base64 of chunks; the first one, JSON, says their sizes and CRC-32.

const TYPES = {
  uint8: Uint8Array,
  int8: Int8Array,
  uint16: Uint16Array,
  int16: Int16Array,
  uint32: Uint32Array,
  int32: Int32Array,
  float32: Float32Array,
  float64: Float64Array,
};

const CRC = new Uint32Array(256).map((_, n) => {
  for (let k = 0; k < 8; k++) n = n & 1 ? (n >>> 1) ^ 0xedb88320 : n >>> 1;
  return n;
});

export class DamagedError extends Error {}

export function crc32(bytes) {
  let crc = -1;
  for (let i = 0; i < bytes.length; i++) crc = (crc >>> 8) ^ CRC[(crc ^ bytes[i]) & 255];
  return ~crc >>> 0;
}

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The inverse of container.py's delta_planes: planes of bytes, signs lowest, sums of rows.
function undelta(planes, bytesPerValue, count, width) {
  const words = { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array, 8: BigUint64Array }[
    bytesPerValue
  ];
  const values = new words(count * width);
  const bytes = new Uint8Array(values.buffer);
  for (let column = 0, n = 0; column < width; column++)
    for (let row = 0; row < count; row++, n++)
      for (let k = 0; k < bytesPerValue; k++)
        bytes[(row * width + column) * bytesPerValue + k] = planes[k * count * width + n];
  const one = bytesPerValue === 8 ? 1n : 1;
  const last = new words(width);
  for (let i = 0; i < values.length; i++) {
    const column = i % width;
    const value = values[i];
    const shifted = bytesPerValue === 8 ? value >> 1n : value >>> 1;
    last[column] += shifted ^ -(value & one);
    values[i] = last[column];
  }
  return values.buffer;
}

async function arrayOf(leaf, chunk) {
  let buffer = (await inflate(chunk)).buffer;
  const type = TYPES[leaf.type];
  const size = leaf.shape.reduce((a, b) => a * b, 1);
  if (leaf.filter) {
    const rows = leaf.shape.length ? leaf.shape[0] : 1;
    const width = rows ? size / rows : 0;
    buffer = undelta(new Uint8Array(buffer), type.BYTES_PER_ELEMENT, rows, width);
  }
  const array = new type(buffer);
  if (array.length !== size) throw new DamagedError('an array has another size than it says');
  array.shape = leaf.shape;
  return array;
}

function pointsOf(leaf, whole) {
  const points = new Float32Array(whole.length);
  for (let i = 0; i < points.length; i++)
    points[i] = leaf.low[i % 3] + leaf.step[i % 3] * whole[i];
  points.shape = leaf.shape;
  return points;
}

function directionsOf(leaf, whole) {
  const count = whole.length / 2;
  const vectors = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) {
    let [x, y] = [whole[2 * i] / 32767, whole[2 * i + 1] / 32767];
    const z = 1 - Math.abs(x) - Math.abs(y);
    const fold = Math.max(-z, 0);
    x += x >= 0 ? -fold : fold;
    y += y >= 0 ? -fold : fold;
    const length = Math.hypot(x, y, z);
    vectors.set([x / length, y / length, z / length], 3 * i);
  }
  vectors.shape = [count, 3];
  return vectors;
}

async function leafOf(leaf, chunks) {
  if (leaf.$leaf === 'number')
    return { 'inf': Infinity, '-inf': -Infinity, 'nan': NaN }[leaf.text];
  const chunk = chunks(leaf.chunk);
  if (leaf.$leaf === 'image') {
    const exact = { premultiplyAlpha: 'none', colorSpaceConversion: 'none' };
    return createImageBitmap(new Blob([chunk], { type: leaf.type }), exact);
  }
  const array = await arrayOf(leaf, chunk);
  if (leaf.$leaf === 'points') return pointsOf(leaf, array);
  return leaf.$leaf === 'directions' ? directionsOf(leaf, array) : array;
}

async function filled(value, chunks) {
  if (Array.isArray(value)) return Promise.all(value.map((item) => filled(item, chunks)));
  if (value === null || typeof value !== 'object') return value;
  if ('$leaf' in value) return leafOf(value, chunks);
  const entries = await Promise.all(
    Object.entries(value).map(async ([key, item]) => [key, await filled(item, chunks)]),
  );
  return Object.fromEntries(entries);
}

// The scene of a document whose parsing has ended.
export async function readScene(document) {
  const text = (number) => {
    const block = document.querySelector(`script[data-chunk="${number}"]`);
    if (!block) throw new DamagedError('the file is cut off');
    return block.textContent;
  };
  let manifest;
  try {
    manifest = JSON.parse(text(0));
  } catch (error) {
    throw new DamagedError(error.message);
  }
  if (!document.getElementById('end')) throw new DamagedError('the file is cut off');
  const chunks = (number) => {
    let bytes;
    try {
      bytes = fromBase64(text(number + 1));
    } catch (error) {
      throw new DamagedError(error.message);
    }
    const said = manifest.chunks[number];
    if (bytes.length !== said.bytes || crc32(bytes) !== said.crc)
      throw new DamagedError(`part ${number + 1} of ${manifest.chunks.length} is damaged`);
    return bytes;
  };
  return filled(manifest.scene, chunks);
}
