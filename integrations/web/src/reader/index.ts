/** Reference reader of enliven's wire: checked against the Python reader by common test vectors. */

export * from "./messages.js";
export { PoseDecoder, spanningTree, type Pose, type PoseLayout } from "./posecode.js";
export { decodeColumns } from "./rice.js";
export { skinVertices, writeMatrices } from "./skinning.js";
export { unpackQuaternions } from "./quaternions.js";
