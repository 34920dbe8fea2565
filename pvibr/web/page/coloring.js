// Values as colors, by the tables of VTK's mappers: below and above their range are colors of their
// own, or those of the ends, and NaN has one.
const GRAY = [128, 128, 128, 255];
const MOST = 1000; // places of a texture that VTK allows

// A function that returns the share of the range at which a value is, not a number for NaN.
export function shareOf({ range, log }) {
  const scale = log && range[0] > 0 ? Math.log10 : (x) => x;
  const [low, high] = range.map(scale);
  const factor = high > low ? 1 / (high - low) : 0;
  // Logarithms of what is not positive are those of the least number.
  return (value) => (scale(log ? Math.max(value, Number.MIN_VALUE) : value) - low) * factor;
}

// Places in a texture that has one texel beyond each end of the table; its upper row is of NaN.
export function texturePlaces(values, coloring) {
  const share = shareOf(coloring);
  const count = coloring.table.length / 4;
  const places = new Float32Array(2 * values.length);
  for (let i = 0; i < values.length; i++) {
    const place = (share(values[i]) * count + 1) / (count + 2);
    const isNaN = Number.isNaN(place);
    places[2 * i] = isNaN ? 0.5 : Math.min(Math.max(place, -MOST), MOST);
    places[2 * i + 1] = isNaN ? 1 : 0.49; // nearly half: what is beside NaN soon has its color
  }
  return places;
}

export function textureOf({ table, nan, below, above }) {
  const width = table.length / 4 + 2;
  const pixels = new Uint8Array(8 * width);
  pixels.set(below ?? table.subarray(0, 4));
  pixels.set(table, 4);
  pixels.set(above ?? table.subarray(-4), 4 * (width - 1));
  for (let i = width; i < 2 * width; i++) pixels.set(nan ?? GRAY, 4 * i);
  return { pixels, width };
}

// A function that returns the color of a value.
export function colorOf(coloring) {
  const { table, nan, below, above } = coloring;
  const share = shareOf(coloring);
  const last = table.length / 4 - 1;
  return (value) => {
    const place = share(value);
    if (Number.isNaN(place)) return nan ?? GRAY;
    if (place < 0 && below) return below;
    if (place > 1 && above) return above;
    const at = 4 * Math.min(Math.max(Math.floor(place * (last + 1)), 0), last);
    return table.subarray(at, at + 4);
  };
}
