/** Unit quaternions in four bytes each: the three smallest components with ten bits each. */

/** Step of a component: all but the largest are within +-sqrt(1/2). */
const COMPONENT_STEP = Math.SQRT1_2 / 511;

/**
 * Returns 4 N numbers, unit quaternions (w, x, y, z) with w >= 0, of 4 N bytes.
 *
 * Of each little-endian number of 32 bits, bits 30-31 are the index of the omitted component (0 is w). The others
 * follow in order, each as 511 + value / step.
 */
export function unpackQuaternions(data: Uint8Array): Float32Array {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const result = new Float32Array(data.byteLength);
  for (let at = 0; at < data.byteLength; at += 4) {
    const bits = view.getUint32(at, true);
    const omitted = bits >>> 30;
    const quaternion = [0, 0, 0, 0];
    let shift = 20;
    for (let component = 0; component < 4; component++) {
      if (component === omitted) continue;
      quaternion[component] = (((bits >>> shift) & 1023) - 511) * COMPONENT_STEP;
      shift -= 10;
    }
    const squares = quaternion.reduce((sum, value) => sum + value * value, 0);
    quaternion[omitted] = Math.sqrt(Math.max(0, 1 - squares));
    const length = Math.hypot(...quaternion) * (quaternion[0] < 0 ? -1 : 1);
    result.set(quaternion.map((value) => value / length), at);
  }
  return result;
}
