// node_modules/@msgpack/msgpack/dist.esm/utils/utf8.mjs
var sharedTextEncoder = new TextEncoder();
var CHUNK_SIZE = 4096;
function utf8DecodeJs(bytes, inputOffset, byteLength) {
  let offset = inputOffset;
  const end = offset + byteLength;
  const units = [];
  let result = "";
  while (offset < end) {
    const byte1 = bytes[offset++];
    if ((byte1 & 128) === 0) {
      units.push(byte1);
    } else if ((byte1 & 224) === 192) {
      const byte2 = bytes[offset++] & 63;
      units.push((byte1 & 31) << 6 | byte2);
    } else if ((byte1 & 240) === 224) {
      const byte2 = bytes[offset++] & 63;
      const byte3 = bytes[offset++] & 63;
      units.push((byte1 & 31) << 12 | byte2 << 6 | byte3);
    } else if ((byte1 & 248) === 240) {
      const byte2 = bytes[offset++] & 63;
      const byte3 = bytes[offset++] & 63;
      const byte4 = bytes[offset++] & 63;
      let unit = (byte1 & 7) << 18 | byte2 << 12 | byte3 << 6 | byte4;
      if (unit > 65535) {
        unit -= 65536;
        units.push(unit >>> 10 & 1023 | 55296);
        unit = 56320 | unit & 1023;
      }
      units.push(unit);
    } else {
      units.push(byte1);
    }
    if (units.length >= CHUNK_SIZE) {
      result += String.fromCharCode(...units);
      units.length = 0;
    }
  }
  if (units.length > 0) {
    result += String.fromCharCode(...units);
  }
  return result;
}
var sharedTextDecoder = new TextDecoder();
var TEXT_DECODER_THRESHOLD = 200;
function utf8DecodeTD(bytes, inputOffset, byteLength) {
  const stringBytes = bytes.subarray(inputOffset, inputOffset + byteLength);
  return sharedTextDecoder.decode(stringBytes);
}
function utf8Decode(bytes, inputOffset, byteLength) {
  if (byteLength > TEXT_DECODER_THRESHOLD) {
    return utf8DecodeTD(bytes, inputOffset, byteLength);
  } else {
    return utf8DecodeJs(bytes, inputOffset, byteLength);
  }
}

// node_modules/@msgpack/msgpack/dist.esm/ExtData.mjs
var ExtData = class {
  type;
  data;
  constructor(type, data) {
    this.type = type;
    this.data = data;
  }
};

// node_modules/@msgpack/msgpack/dist.esm/DecodeError.mjs
var DecodeError = class _DecodeError extends Error {
  constructor(message) {
    super(message);
    const proto = Object.create(_DecodeError.prototype);
    Object.setPrototypeOf(this, proto);
    Object.defineProperty(this, "name", {
      configurable: true,
      enumerable: false,
      value: _DecodeError.name
    });
  }
};

// node_modules/@msgpack/msgpack/dist.esm/utils/int.mjs
var UINT32_MAX = 4294967295;
function setInt64(view, offset, value) {
  const high = Math.floor(value / 4294967296);
  const low = value;
  view.setUint32(offset, high);
  view.setUint32(offset + 4, low);
}
function getInt64(view, offset) {
  const high = view.getInt32(offset);
  const low = view.getUint32(offset + 4);
  return high * 4294967296 + low;
}
function getUint64(view, offset) {
  const high = view.getUint32(offset);
  const low = view.getUint32(offset + 4);
  return high * 4294967296 + low;
}

// node_modules/@msgpack/msgpack/dist.esm/timestamp.mjs
var EXT_TIMESTAMP = -1;
var TIMESTAMP32_MAX_SEC = 4294967296 - 1;
var TIMESTAMP64_MAX_SEC = 17179869184 - 1;
function encodeTimeSpecToTimestamp({ sec, nsec }) {
  if (sec >= 0 && nsec >= 0 && sec <= TIMESTAMP64_MAX_SEC) {
    if (nsec === 0 && sec <= TIMESTAMP32_MAX_SEC) {
      const rv = new Uint8Array(4);
      const view = new DataView(rv.buffer);
      view.setUint32(0, sec);
      return rv;
    } else {
      const secHigh = sec / 4294967296;
      const secLow = sec & 4294967295;
      const rv = new Uint8Array(8);
      const view = new DataView(rv.buffer);
      view.setUint32(0, nsec << 2 | secHigh & 3);
      view.setUint32(4, secLow);
      return rv;
    }
  } else {
    const rv = new Uint8Array(12);
    const view = new DataView(rv.buffer);
    view.setUint32(0, nsec);
    setInt64(view, 4, sec);
    return rv;
  }
}
function encodeDateToTimeSpec(date) {
  const msec = date.getTime();
  const sec = Math.floor(msec / 1e3);
  const nsec = (msec - sec * 1e3) * 1e6;
  const nsecInSec = Math.floor(nsec / 1e9);
  return {
    sec: sec + nsecInSec,
    nsec: nsec - nsecInSec * 1e9
  };
}
function encodeTimestampExtension(object) {
  if (object instanceof Date) {
    const timeSpec = encodeDateToTimeSpec(object);
    return encodeTimeSpecToTimestamp(timeSpec);
  } else {
    return null;
  }
}
function decodeTimestampToTimeSpec(data) {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  switch (data.byteLength) {
    case 4: {
      const sec = view.getUint32(0);
      const nsec = 0;
      return { sec, nsec };
    }
    case 8: {
      const nsec30AndSecHigh2 = view.getUint32(0);
      const secLow32 = view.getUint32(4);
      const sec = (nsec30AndSecHigh2 & 3) * 4294967296 + secLow32;
      const nsec = nsec30AndSecHigh2 >>> 2;
      return { sec, nsec };
    }
    case 12: {
      const sec = getInt64(view, 4);
      const nsec = view.getUint32(0);
      return { sec, nsec };
    }
    default:
      throw new DecodeError(`Unrecognized data size for timestamp (expected 4, 8, or 12): ${data.length}`);
  }
}
function decodeTimestampExtension(data) {
  const timeSpec = decodeTimestampToTimeSpec(data);
  return new Date(timeSpec.sec * 1e3 + timeSpec.nsec / 1e6);
}
var timestampExtension = {
  type: EXT_TIMESTAMP,
  encode: encodeTimestampExtension,
  decode: decodeTimestampExtension
};

// node_modules/@msgpack/msgpack/dist.esm/ExtensionCodec.mjs
var ExtensionCodec = class _ExtensionCodec {
  static defaultCodec = new _ExtensionCodec();
  // ensures ExtensionCodecType<X> matches ExtensionCodec<X>
  // this will make type errors a lot more clear
  // eslint-disable-next-line @typescript-eslint/naming-convention
  __brand;
  // built-in extensions
  builtInEncoders = [];
  builtInDecoders = [];
  // custom extensions
  encoders = [];
  decoders = [];
  constructor() {
    this.register(timestampExtension);
  }
  register({ type, encode, decode: decode2 }) {
    if (type >= 0) {
      this.encoders[type] = encode;
      this.decoders[type] = decode2;
    } else {
      const index = -1 - type;
      this.builtInEncoders[index] = encode;
      this.builtInDecoders[index] = decode2;
    }
  }
  tryToEncode(object, context) {
    for (let i = 0; i < this.builtInEncoders.length; i++) {
      const encodeExt = this.builtInEncoders[i];
      if (encodeExt != null) {
        const data = encodeExt(object, context);
        if (data != null) {
          const type = -1 - i;
          return new ExtData(type, data);
        }
      }
    }
    for (let i = 0; i < this.encoders.length; i++) {
      const encodeExt = this.encoders[i];
      if (encodeExt != null) {
        const data = encodeExt(object, context);
        if (data != null) {
          const type = i;
          return new ExtData(type, data);
        }
      }
    }
    if (object instanceof ExtData) {
      return object;
    }
    return null;
  }
  decode(data, type, context) {
    const decodeExt = type < 0 ? this.builtInDecoders[-1 - type] : this.decoders[type];
    if (decodeExt) {
      return decodeExt(data, type, context);
    } else {
      return new ExtData(type, data);
    }
  }
};

// node_modules/@msgpack/msgpack/dist.esm/utils/typedArrays.mjs
function isArrayBufferLike(buffer) {
  return buffer instanceof ArrayBuffer || typeof SharedArrayBuffer !== "undefined" && buffer instanceof SharedArrayBuffer;
}
function ensureUint8Array(buffer) {
  if (buffer instanceof Uint8Array) {
    return buffer;
  } else if (ArrayBuffer.isView(buffer)) {
    return new Uint8Array(buffer.buffer, buffer.byteOffset, buffer.byteLength);
  } else if (isArrayBufferLike(buffer)) {
    return new Uint8Array(buffer);
  } else {
    return Uint8Array.from(buffer);
  }
}

// node_modules/@msgpack/msgpack/dist.esm/utils/prettyByte.mjs
function prettyByte(byte) {
  return `${byte < 0 ? "-" : ""}0x${Math.abs(byte).toString(16).padStart(2, "0")}`;
}

// node_modules/@msgpack/msgpack/dist.esm/CachedKeyDecoder.mjs
var DEFAULT_MAX_KEY_LENGTH = 16;
var DEFAULT_MAX_LENGTH_PER_KEY = 16;
var CachedKeyDecoder = class {
  hit = 0;
  miss = 0;
  caches;
  maxKeyLength;
  maxLengthPerKey;
  constructor(maxKeyLength = DEFAULT_MAX_KEY_LENGTH, maxLengthPerKey = DEFAULT_MAX_LENGTH_PER_KEY) {
    this.maxKeyLength = maxKeyLength;
    this.maxLengthPerKey = maxLengthPerKey;
    this.caches = [];
    for (let i = 0; i < this.maxKeyLength; i++) {
      this.caches.push([]);
    }
  }
  canBeCached(byteLength) {
    return byteLength > 0 && byteLength <= this.maxKeyLength;
  }
  find(bytes, inputOffset, byteLength) {
    const records = this.caches[byteLength - 1];
    FIND_CHUNK: for (const record of records) {
      const recordBytes = record.bytes;
      for (let j = 0; j < byteLength; j++) {
        if (recordBytes[j] !== bytes[inputOffset + j]) {
          continue FIND_CHUNK;
        }
      }
      return record.str;
    }
    return null;
  }
  store(bytes, value) {
    const records = this.caches[bytes.length - 1];
    const record = { bytes, str: value };
    if (records.length >= this.maxLengthPerKey) {
      records[Math.random() * records.length | 0] = record;
    } else {
      records.push(record);
    }
  }
  decode(bytes, inputOffset, byteLength) {
    const cachedValue = this.find(bytes, inputOffset, byteLength);
    if (cachedValue != null) {
      this.hit++;
      return cachedValue;
    }
    this.miss++;
    const str = utf8DecodeJs(bytes, inputOffset, byteLength);
    const slicedCopyOfBytes = Uint8Array.prototype.slice.call(bytes, inputOffset, inputOffset + byteLength);
    this.store(slicedCopyOfBytes, str);
    return str;
  }
};

// node_modules/@msgpack/msgpack/dist.esm/Decoder.mjs
var STATE_ARRAY = "array";
var STATE_MAP_KEY = "map_key";
var STATE_MAP_VALUE = "map_value";
var mapKeyConverter = (key) => {
  if (typeof key === "string" || typeof key === "number") {
    return key;
  }
  throw new DecodeError("The type of key must be string or number but " + typeof key);
};
var StackPool = class {
  stack = [];
  stackHeadPosition = -1;
  get length() {
    return this.stackHeadPosition + 1;
  }
  top() {
    return this.stack[this.stackHeadPosition];
  }
  pushArrayState(size) {
    const state = this.getUninitializedStateFromPool();
    state.type = STATE_ARRAY;
    state.position = 0;
    state.size = size;
    state.array = new Array(size);
  }
  pushMapState(size) {
    const state = this.getUninitializedStateFromPool();
    state.type = STATE_MAP_KEY;
    state.readCount = 0;
    state.size = size;
    state.map = {};
  }
  getUninitializedStateFromPool() {
    this.stackHeadPosition++;
    if (this.stackHeadPosition === this.stack.length) {
      const partialState = {
        type: void 0,
        size: 0,
        array: void 0,
        position: 0,
        readCount: 0,
        map: void 0,
        key: null
      };
      this.stack.push(partialState);
    }
    return this.stack[this.stackHeadPosition];
  }
  release(state) {
    const topStackState = this.stack[this.stackHeadPosition];
    if (topStackState !== state) {
      throw new Error("Invalid stack state. Released state is not on top of the stack.");
    }
    if (state.type === STATE_ARRAY) {
      const partialState = state;
      partialState.size = 0;
      partialState.array = void 0;
      partialState.position = 0;
      partialState.type = void 0;
    }
    if (state.type === STATE_MAP_KEY || state.type === STATE_MAP_VALUE) {
      const partialState = state;
      partialState.size = 0;
      partialState.map = void 0;
      partialState.readCount = 0;
      partialState.type = void 0;
    }
    this.stackHeadPosition--;
  }
  reset() {
    this.stack.length = 0;
    this.stackHeadPosition = -1;
  }
};
var HEAD_BYTE_REQUIRED = -1;
var EMPTY_VIEW = new DataView(new ArrayBuffer(0));
var EMPTY_BYTES = new Uint8Array(EMPTY_VIEW.buffer);
try {
  EMPTY_VIEW.getInt8(0);
} catch (e) {
  if (!(e instanceof RangeError)) {
    throw new Error("This module is not supported in the current JavaScript engine because DataView does not throw RangeError on out-of-bounds access");
  }
}
var MORE_DATA = new RangeError("Insufficient data");
var sharedCachedKeyDecoder = new CachedKeyDecoder();
var Decoder = class _Decoder {
  extensionCodec;
  context;
  useBigInt64;
  rawStrings;
  maxStrLength;
  maxBinLength;
  maxArrayLength;
  maxMapLength;
  maxExtLength;
  keyDecoder;
  mapKeyConverter;
  totalPos = 0;
  pos = 0;
  view = EMPTY_VIEW;
  bytes = EMPTY_BYTES;
  headByte = HEAD_BYTE_REQUIRED;
  stack = new StackPool();
  entered = false;
  constructor(options) {
    this.extensionCodec = options?.extensionCodec ?? ExtensionCodec.defaultCodec;
    this.context = options?.context;
    this.useBigInt64 = options?.useBigInt64 ?? false;
    this.rawStrings = options?.rawStrings ?? false;
    this.maxStrLength = options?.maxStrLength ?? UINT32_MAX;
    this.maxBinLength = options?.maxBinLength ?? UINT32_MAX;
    this.maxArrayLength = options?.maxArrayLength ?? UINT32_MAX;
    this.maxMapLength = options?.maxMapLength ?? UINT32_MAX;
    this.maxExtLength = options?.maxExtLength ?? UINT32_MAX;
    this.keyDecoder = options?.keyDecoder !== void 0 ? options.keyDecoder : sharedCachedKeyDecoder;
    this.mapKeyConverter = options?.mapKeyConverter ?? mapKeyConverter;
  }
  clone() {
    return new _Decoder({
      extensionCodec: this.extensionCodec,
      context: this.context,
      useBigInt64: this.useBigInt64,
      rawStrings: this.rawStrings,
      maxStrLength: this.maxStrLength,
      maxBinLength: this.maxBinLength,
      maxArrayLength: this.maxArrayLength,
      maxMapLength: this.maxMapLength,
      maxExtLength: this.maxExtLength,
      keyDecoder: this.keyDecoder
    });
  }
  reinitializeState() {
    this.totalPos = 0;
    this.headByte = HEAD_BYTE_REQUIRED;
    this.stack.reset();
  }
  setBuffer(buffer) {
    const bytes = ensureUint8Array(buffer);
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.pos = 0;
  }
  appendBuffer(buffer) {
    if (this.headByte === HEAD_BYTE_REQUIRED && !this.hasRemaining(1)) {
      this.setBuffer(buffer);
    } else {
      const remainingData = this.bytes.subarray(this.pos);
      const newData = ensureUint8Array(buffer);
      const newBuffer = new Uint8Array(remainingData.length + newData.length);
      newBuffer.set(remainingData);
      newBuffer.set(newData, remainingData.length);
      this.setBuffer(newBuffer);
    }
  }
  hasRemaining(size) {
    return this.view.byteLength - this.pos >= size;
  }
  createExtraByteError(posToShow) {
    const { view, pos } = this;
    return new RangeError(`Extra ${view.byteLength - pos} of ${view.byteLength} byte(s) found at buffer[${posToShow}]`);
  }
  /**
   * @throws {@link DecodeError}
   * @throws {@link RangeError}
   */
  decode(buffer) {
    if (this.entered) {
      const instance = this.clone();
      return instance.decode(buffer);
    }
    try {
      this.entered = true;
      this.reinitializeState();
      this.setBuffer(buffer);
      const object = this.doDecodeSync();
      if (this.hasRemaining(1)) {
        throw this.createExtraByteError(this.pos);
      }
      return object;
    } finally {
      this.entered = false;
    }
  }
  *decodeMulti(buffer) {
    if (this.entered) {
      const instance = this.clone();
      yield* instance.decodeMulti(buffer);
      return;
    }
    try {
      this.entered = true;
      this.reinitializeState();
      this.setBuffer(buffer);
      while (this.hasRemaining(1)) {
        yield this.doDecodeSync();
      }
    } finally {
      this.entered = false;
    }
  }
  async decodeAsync(stream) {
    if (this.entered) {
      const instance = this.clone();
      return instance.decodeAsync(stream);
    }
    try {
      this.entered = true;
      let decoded = false;
      let object;
      for await (const buffer of stream) {
        if (decoded) {
          this.entered = false;
          throw this.createExtraByteError(this.totalPos);
        }
        this.appendBuffer(buffer);
        try {
          object = this.doDecodeSync();
          decoded = true;
        } catch (e) {
          if (!(e instanceof RangeError)) {
            throw e;
          }
        }
        this.totalPos += this.pos;
      }
      if (decoded) {
        if (this.hasRemaining(1)) {
          throw this.createExtraByteError(this.totalPos);
        }
        return object;
      }
      const { headByte, pos, totalPos } = this;
      throw new RangeError(`Insufficient data in parsing ${prettyByte(headByte)} at ${totalPos} (${pos} in the current buffer)`);
    } finally {
      this.entered = false;
    }
  }
  decodeArrayStream(stream) {
    return this.decodeMultiAsync(stream, true);
  }
  decodeStream(stream) {
    return this.decodeMultiAsync(stream, false);
  }
  async *decodeMultiAsync(stream, isArray) {
    if (this.entered) {
      const instance = this.clone();
      yield* instance.decodeMultiAsync(stream, isArray);
      return;
    }
    try {
      this.entered = true;
      let isArrayHeaderRequired = isArray;
      let arrayItemsLeft = -1;
      for await (const buffer of stream) {
        if (isArray && arrayItemsLeft === 0) {
          throw this.createExtraByteError(this.totalPos);
        }
        this.appendBuffer(buffer);
        if (isArrayHeaderRequired) {
          arrayItemsLeft = this.readArraySize();
          isArrayHeaderRequired = false;
          this.complete();
        }
        try {
          while (true) {
            yield this.doDecodeSync();
            if (--arrayItemsLeft === 0) {
              break;
            }
          }
        } catch (e) {
          if (!(e instanceof RangeError)) {
            throw e;
          }
        }
        this.totalPos += this.pos;
      }
    } finally {
      this.entered = false;
    }
  }
  doDecodeSync() {
    DECODE: while (true) {
      const headByte = this.readHeadByte();
      let object;
      if (headByte >= 224) {
        object = headByte - 256;
      } else if (headByte < 192) {
        if (headByte < 128) {
          object = headByte;
        } else if (headByte < 144) {
          const size = headByte - 128;
          if (size !== 0) {
            this.pushMapState(size);
            this.complete();
            continue DECODE;
          } else {
            object = {};
          }
        } else if (headByte < 160) {
          const size = headByte - 144;
          if (size !== 0) {
            this.pushArrayState(size);
            this.complete();
            continue DECODE;
          } else {
            object = [];
          }
        } else {
          const byteLength = headByte - 160;
          object = this.decodeString(byteLength, 0);
        }
      } else if (headByte === 192) {
        object = null;
      } else if (headByte === 194) {
        object = false;
      } else if (headByte === 195) {
        object = true;
      } else if (headByte === 202) {
        object = this.readF32();
      } else if (headByte === 203) {
        object = this.readF64();
      } else if (headByte === 204) {
        object = this.readU8();
      } else if (headByte === 205) {
        object = this.readU16();
      } else if (headByte === 206) {
        object = this.readU32();
      } else if (headByte === 207) {
        if (this.useBigInt64) {
          object = this.readU64AsBigInt();
        } else {
          object = this.readU64();
        }
      } else if (headByte === 208) {
        object = this.readI8();
      } else if (headByte === 209) {
        object = this.readI16();
      } else if (headByte === 210) {
        object = this.readI32();
      } else if (headByte === 211) {
        if (this.useBigInt64) {
          object = this.readI64AsBigInt();
        } else {
          object = this.readI64();
        }
      } else if (headByte === 217) {
        const byteLength = this.lookU8();
        object = this.decodeString(byteLength, 1);
      } else if (headByte === 218) {
        const byteLength = this.lookU16();
        object = this.decodeString(byteLength, 2);
      } else if (headByte === 219) {
        const byteLength = this.lookU32();
        object = this.decodeString(byteLength, 4);
      } else if (headByte === 220) {
        const size = this.readU16();
        if (size !== 0) {
          this.pushArrayState(size);
          this.complete();
          continue DECODE;
        } else {
          object = [];
        }
      } else if (headByte === 221) {
        const size = this.readU32();
        if (size !== 0) {
          this.pushArrayState(size);
          this.complete();
          continue DECODE;
        } else {
          object = [];
        }
      } else if (headByte === 222) {
        const size = this.readU16();
        if (size !== 0) {
          this.pushMapState(size);
          this.complete();
          continue DECODE;
        } else {
          object = {};
        }
      } else if (headByte === 223) {
        const size = this.readU32();
        if (size !== 0) {
          this.pushMapState(size);
          this.complete();
          continue DECODE;
        } else {
          object = {};
        }
      } else if (headByte === 196) {
        const size = this.lookU8();
        object = this.decodeBinary(size, 1);
      } else if (headByte === 197) {
        const size = this.lookU16();
        object = this.decodeBinary(size, 2);
      } else if (headByte === 198) {
        const size = this.lookU32();
        object = this.decodeBinary(size, 4);
      } else if (headByte === 212) {
        object = this.decodeExtension(1, 0);
      } else if (headByte === 213) {
        object = this.decodeExtension(2, 0);
      } else if (headByte === 214) {
        object = this.decodeExtension(4, 0);
      } else if (headByte === 215) {
        object = this.decodeExtension(8, 0);
      } else if (headByte === 216) {
        object = this.decodeExtension(16, 0);
      } else if (headByte === 199) {
        const size = this.lookU8();
        object = this.decodeExtension(size, 1);
      } else if (headByte === 200) {
        const size = this.lookU16();
        object = this.decodeExtension(size, 2);
      } else if (headByte === 201) {
        const size = this.lookU32();
        object = this.decodeExtension(size, 4);
      } else {
        throw new DecodeError(`Unrecognized type byte: ${prettyByte(headByte)}`);
      }
      this.complete();
      const stack = this.stack;
      while (stack.length > 0) {
        const state = stack.top();
        if (state.type === STATE_ARRAY) {
          state.array[state.position] = object;
          state.position++;
          if (state.position === state.size) {
            object = state.array;
            stack.release(state);
          } else {
            continue DECODE;
          }
        } else if (state.type === STATE_MAP_KEY) {
          if (object === "__proto__") {
            throw new DecodeError("The key __proto__ is not allowed");
          }
          state.key = this.mapKeyConverter(object);
          state.type = STATE_MAP_VALUE;
          continue DECODE;
        } else {
          state.map[state.key] = object;
          state.readCount++;
          if (state.readCount === state.size) {
            object = state.map;
            stack.release(state);
          } else {
            state.key = null;
            state.type = STATE_MAP_KEY;
            continue DECODE;
          }
        }
      }
      return object;
    }
  }
  readHeadByte() {
    if (this.headByte === HEAD_BYTE_REQUIRED) {
      this.headByte = this.readU8();
    }
    return this.headByte;
  }
  complete() {
    this.headByte = HEAD_BYTE_REQUIRED;
  }
  readArraySize() {
    const headByte = this.readHeadByte();
    switch (headByte) {
      case 220:
        return this.readU16();
      case 221:
        return this.readU32();
      default: {
        if (headByte < 160) {
          return headByte - 144;
        } else {
          throw new DecodeError(`Unrecognized array type byte: ${prettyByte(headByte)}`);
        }
      }
    }
  }
  pushMapState(size) {
    if (size > this.maxMapLength) {
      throw new DecodeError(`Max length exceeded: map length (${size}) > maxMapLengthLength (${this.maxMapLength})`);
    }
    this.stack.pushMapState(size);
  }
  pushArrayState(size) {
    if (size > this.maxArrayLength) {
      throw new DecodeError(`Max length exceeded: array length (${size}) > maxArrayLength (${this.maxArrayLength})`);
    }
    this.stack.pushArrayState(size);
  }
  decodeString(byteLength, headerOffset) {
    if (!this.rawStrings || this.stateIsMapKey()) {
      return this.decodeUtf8String(byteLength, headerOffset);
    }
    return this.decodeBinary(byteLength, headerOffset);
  }
  /**
   * @throws {@link RangeError}
   */
  decodeUtf8String(byteLength, headerOffset) {
    if (byteLength > this.maxStrLength) {
      throw new DecodeError(`Max length exceeded: UTF-8 byte length (${byteLength}) > maxStrLength (${this.maxStrLength})`);
    }
    if (this.bytes.byteLength < this.pos + headerOffset + byteLength) {
      throw MORE_DATA;
    }
    const offset = this.pos + headerOffset;
    let object;
    if (this.stateIsMapKey() && this.keyDecoder?.canBeCached(byteLength)) {
      object = this.keyDecoder.decode(this.bytes, offset, byteLength);
    } else {
      object = utf8Decode(this.bytes, offset, byteLength);
    }
    this.pos += headerOffset + byteLength;
    return object;
  }
  stateIsMapKey() {
    if (this.stack.length > 0) {
      const state = this.stack.top();
      return state.type === STATE_MAP_KEY;
    }
    return false;
  }
  /**
   * @throws {@link RangeError}
   */
  decodeBinary(byteLength, headOffset) {
    if (byteLength > this.maxBinLength) {
      throw new DecodeError(`Max length exceeded: bin length (${byteLength}) > maxBinLength (${this.maxBinLength})`);
    }
    if (!this.hasRemaining(byteLength + headOffset)) {
      throw MORE_DATA;
    }
    const offset = this.pos + headOffset;
    const object = this.bytes.subarray(offset, offset + byteLength);
    this.pos += headOffset + byteLength;
    return object;
  }
  decodeExtension(size, headOffset) {
    if (size > this.maxExtLength) {
      throw new DecodeError(`Max length exceeded: ext length (${size}) > maxExtLength (${this.maxExtLength})`);
    }
    const extType = this.view.getInt8(this.pos + headOffset);
    const data = this.decodeBinary(
      size,
      headOffset + 1
      /* extType */
    );
    return this.extensionCodec.decode(data, extType, this.context);
  }
  lookU8() {
    return this.view.getUint8(this.pos);
  }
  lookU16() {
    return this.view.getUint16(this.pos);
  }
  lookU32() {
    return this.view.getUint32(this.pos);
  }
  readU8() {
    const value = this.view.getUint8(this.pos);
    this.pos++;
    return value;
  }
  readI8() {
    const value = this.view.getInt8(this.pos);
    this.pos++;
    return value;
  }
  readU16() {
    const value = this.view.getUint16(this.pos);
    this.pos += 2;
    return value;
  }
  readI16() {
    const value = this.view.getInt16(this.pos);
    this.pos += 2;
    return value;
  }
  readU32() {
    const value = this.view.getUint32(this.pos);
    this.pos += 4;
    return value;
  }
  readI32() {
    const value = this.view.getInt32(this.pos);
    this.pos += 4;
    return value;
  }
  readU64() {
    const value = getUint64(this.view, this.pos);
    this.pos += 8;
    return value;
  }
  readI64() {
    const value = getInt64(this.view, this.pos);
    this.pos += 8;
    return value;
  }
  readU64AsBigInt() {
    const value = this.view.getBigUint64(this.pos);
    this.pos += 8;
    return value;
  }
  readI64AsBigInt() {
    const value = this.view.getBigInt64(this.pos);
    this.pos += 8;
    return value;
  }
  readF32() {
    const value = this.view.getFloat32(this.pos);
    this.pos += 4;
    return value;
  }
  readF64() {
    const value = this.view.getFloat64(this.pos);
    this.pos += 8;
    return value;
  }
};

// node_modules/@msgpack/msgpack/dist.esm/decode.mjs
function decode(buffer, options) {
  const decoder = new Decoder(options);
  return decoder.decode(buffer);
}

// src/reader/crc32.ts
var TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let value = byte;
  for (let bit = 0; bit < 8; bit++) value = value & 1 ? value >>> 1 ^ 3988292384 : value >>> 1;
  return value;
});
function crc32(data) {
  let value = 4294967295;
  for (const byte of data) value = value >>> 8 ^ TABLE[(value ^ byte) & 255];
  return ~value >>> 0;
}

// src/reader/rice.ts
var PARAMETER_BITS = 4;
var ALL_ZERO = 15;
var ESCAPE = 12;
var ESCAPE_BITS = 22;
var BitReader = class {
  constructor(data) {
    this.data = data;
  }
  data;
  at = 0;
  /** Returns the next `count` bits, at most 22, as an unsigned integer. */
  read(count) {
    if (this.at + count > 8 * this.data.length) throw new RangeError("the coded numbers are truncated");
    let value = 0;
    for (let remaining = count; remaining > 0; ) {
      const available = 8 - (this.at & 7);
      const width = Math.min(available, remaining);
      const bits = this.data[this.at >> 3] >> available - width & (1 << width) - 1;
      value = value << width | bits;
      this.at += width;
      remaining -= width;
    }
    return value;
  }
  /** Throws a RangeError unless fewer than 8 bits remain, all of them 0. */
  expectEnd() {
    const remaining = 8 * this.data.length - this.at;
    if (remaining >= 8 || this.read(remaining) !== 0) throw new RangeError("bytes follow the coded numbers");
  }
};
function decodeColumns(data, rows, columns) {
  const table = new Int32Array(rows * columns);
  const bits = new BitReader(data);
  for (let column = 0; column < columns; column++) {
    const parameter = bits.read(PARAMETER_BITS);
    if (parameter === ALL_ZERO) continue;
    for (let row = 0; row < rows; row++) {
      let quotient = 0;
      while (quotient < ESCAPE && bits.read(1) === 1) quotient++;
      const folded = quotient < ESCAPE ? bits.read(parameter) | quotient << parameter : bits.read(ESCAPE_BITS);
      table[row * columns + column] = folded & 1 ? -(folded >> 1) - 1 : folded >> 1;
    }
  }
  bits.expectEnd();
  return table;
}

// src/reader/posecode.ts
var COLUMNS = 12;
var POSITION_STEP = 2 ** -12;
var ROTATION_STEP = 2 ** -10;
var STRETCH_STEP = 2 ** -9;
var UNLINKED_PENALTY_M2 = 1e9;
function spanningTree(pivots, edges) {
  const count = pivots.length / 3;
  const neighbours = Array.from({ length: count }, () => /* @__PURE__ */ new Set());
  for (let edge = 0; edge < edges.length; edge += 2) {
    neighbours[edges[edge]].add(edges[edge + 1]);
    neighbours[edges[edge + 1]].add(edges[edge]);
  }
  const cost = new Float64Array(count).fill(Infinity);
  const parents = new Int32Array(count).fill(-1);
  const isJoined = new Uint8Array(count);
  const order = new Int32Array(count);
  let node = 0;
  for (let step = 0; step < count; step++) {
    order[step] = node;
    isJoined[node] = 1;
    let nearest = -1;
    for (let other = 0; other < count; other++) {
      if (isJoined[other]) continue;
      const x = pivots[3 * other] - pivots[3 * node];
      const y = pivots[3 * other + 1] - pivots[3 * node + 1];
      const z = pivots[3 * other + 2] - pivots[3 * node + 2];
      const distance = x * x + y * y + z * z;
      const penalized = neighbours[node].has(other) ? distance : distance + UNLINKED_PENALTY_M2;
      if (penalized < cost[other]) {
        cost[other] = penalized;
        parents[other] = node;
      }
      if (nearest < 0 || cost[other] < cost[nearest]) nearest = other;
    }
    node = Math.max(nearest, 0);
  }
  return { order, parents };
}
var PoseDecoder = class {
  constructor(layout) {
    this.layout = layout;
    this.tree = spanningTree(layout.pivots, layout.edges);
    this.isGraph = layout.kind === "graph";
    const parts = [layout.pivots, this.tree.order, this.tree.parents];
    const bytes = new Uint8Array(parts.reduce((sum, part) => sum + part.byteLength, 0));
    let at = 0;
    for (const part of parts) {
      bytes.set(new Uint8Array(part.buffer, part.byteOffset, part.byteLength), at);
      at += part.byteLength;
    }
    this.checksum = crc32(bytes);
  }
  layout;
  tree;
  isGraph;
  checksum;
  /**
   * Returns the pose of some bytes.
   *
   * Throws a RangeError if the bytes belong to another revision of the character, or are damaged.
   */
  decode(data) {
    const check = data.length < 4 ? -1 : new DataView(data.buffer, data.byteOffset).getUint32(0, true);
    if (check !== this.checksum) throw new RangeError("the pose belongs to another revision of the character");
    const count = this.tree.order.length;
    return this.restore(decodeColumns(data.subarray(4), count, COLUMNS));
  }
  /** Returns the pose of a table of differences, in double precision until the end. */
  restore(table) {
    const { order, parents } = this.tree;
    const { pivots } = this.layout;
    const count = order.length;
    const linear = new Float64Array(9 * count);
    const positions = new Float64Array(3 * count);
    const quaternions = new Float64Array(4 * count);
    const stretches = new Int32Array(6 * count);
    for (let row = 0; row < count; row++) {
      const node = order[row];
      const parent = parents[node];
      const differences = table.subarray(COLUMNS * row, COLUMNS * (row + 1));
      restoreRotation(quaternions, node, parent, differences);
      for (let c = 0; c < 6; c++) {
        const inherited = parent >= 0 ? stretches[6 * parent + c] : 0;
        stretches[6 * node + c] = differences[6 + c] + inherited;
      }
      writeLinear(quaternions, stretches, node, linear);
      for (let a = 0; a < 3; a++) {
        let expected = parent < 0 ? pivots[3 * node + a] : positions[3 * parent + a];
        for (let b = 0; b < 3 && parent >= 0; b++) {
          let entry = linear[9 * parent + 3 * a + b];
          if (this.isGraph) entry = 0.5 * (entry + linear[9 * node + 3 * a + b]);
          expected += entry * (pivots[3 * node + b] - pivots[3 * parent + b]);
        }
        positions[3 * node + a] = expected + differences[a] * POSITION_STEP;
      }
    }
    return { linear: Float32Array.from(linear), positions: Float32Array.from(positions) };
  }
};
function restoreRotation(quaternions, node, parent, differences) {
  const vx = differences[3] * ROTATION_STEP;
  const vy = differences[4] * ROTATION_STEP;
  const vz = differences[5] * ROTATION_STEP;
  const angle = Math.sqrt(vx * vx + vy * vy + vz * vz);
  const scale = angle > 1e-12 ? Math.sin(0.5 * angle) / angle : 0.5;
  const [w, x, y, z] = [Math.cos(0.5 * angle), scale * vx, scale * vy, scale * vz];
  const [a, b, c, d] = parent >= 0 ? quaternions.subarray(4 * parent, 4 * parent + 4) : [1, 0, 0, 0];
  const q0 = a * w - b * x - c * y - d * z;
  const q1 = a * x + b * w + c * z - d * y;
  const q2 = a * y - b * z + c * w + d * x;
  const q3 = a * z + b * y - c * x + d * w;
  const unit = (q0 >= 0 ? 1 : -1) / Math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3);
  quaternions.set([unit * q0, unit * q1, unit * q2, unit * q3], 4 * node);
}
function writeLinear(quaternions, stretches, node, linear) {
  const [w, x, y, z] = quaternions.subarray(4 * node, 4 * node + 4);
  const rotation = [
    1 - 2 * (y * y + z * z),
    2 * (x * y - w * z),
    2 * (x * z + w * y),
    2 * (x * y + w * z),
    1 - 2 * (x * x + z * z),
    2 * (y * z - w * x),
    2 * (x * z - w * y),
    2 * (y * z + w * x),
    1 - 2 * (x * x + y * y)
  ];
  const s = Array.from(stretches.subarray(6 * node, 6 * node + 6), (steps) => steps * STRETCH_STEP);
  for (let m = 0; m < 3; m++) {
    const [r0, r1, r2] = rotation.slice(3 * m, 3 * m + 3);
    linear[9 * node + 3 * m] = r0 * (1 + s[0]) + r1 * s[3] + r2 * s[4];
    linear[9 * node + 3 * m + 1] = r0 * s[3] + r1 * (1 + s[1]) + r2 * s[5];
    linear[9 * node + 3 * m + 2] = r0 * s[4] + r1 * s[5] + r2 * (1 + s[2]);
  }
}

// src/reader/quaternions.ts
var COMPONENT_STEP = Math.SQRT1_2 / 511;
function unpackQuaternions(data) {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const result = new Float32Array(data.byteLength);
  for (let at = 0; at < data.byteLength; at += 4) {
    const bits = view.getUint32(at, true);
    const omitted = bits >>> 30;
    const quaternion = [0, 0, 0, 0];
    let shift = 20;
    for (let component = 0; component < 4; component++) {
      if (component === omitted) continue;
      quaternion[component] = ((bits >>> shift & 1023) - 511) * COMPONENT_STEP;
      shift -= 10;
    }
    const squares = quaternion.reduce((sum, value) => sum + value * value, 0);
    quaternion[omitted] = Math.sqrt(Math.max(0, 1 - squares));
    const length = Math.hypot(...quaternion) * (quaternion[0] < 0 ? -1 : 1);
    result.set(quaternion.map((value) => value / length), at);
  }
  return result;
}

// src/reader/messages.ts
var VERSION = 1;
var JOINT_STEP = 2 ** -11;
var JOINT_COUNT = 20;
var JOINT_PARENTS = [-1, 0, 1, 2, 2, 4, 5, 6, 2, 8, 9, 10, 0, 12, 13, 14, 0, 16, 17, 18];
var OtherVersionError = class extends Error {
  constructor(version) {
    super(`the edge speaks version ${version} of the wire, this page version ${VERSION}`);
    this.version = version;
  }
  version;
};
function splitStream(data) {
  const end = data.subarray(0, 64).indexOf(0);
  if (end < 0 || data.length < end + 2) throw new RangeError("a stream message has no topic");
  if (data[end + 1] !== VERSION) throw new OtherVersionError(data[end + 1]);
  return { topic: String.fromCharCode(...data.subarray(0, end)), payload: data.subarray(end + 2) };
}
function readStream(data) {
  const { topic, payload } = splitStream(data);
  const read = READERS[topic];
  if (read === void 0) return { topic: "other", name: topic };
  const fields = decode(payload);
  if (!Array.isArray(fields)) throw new RangeError(`the message ${topic} is not an array`);
  return { topic, value: read(fields) };
}
var READERS = {
  pose: (f) => ({
    character: f[0],
    revision: f[1],
    instance: f[2],
    sequence: f[3],
    timeNs: f[4],
    capturedNs: f[5],
    publishedNs: f[6],
    transforms: f[7]
  }),
  bodies: (f) => ({ timeNs: f[0], capturedNs: f[1], bodies: f[2].map(readBody) }),
  cues: (f) => ({
    character: f[0],
    state: f[1],
    nodes: uint16(f[2]),
    strengths: fractions(f[3]),
    performers: f[7]?.length ? f[7] : f[4] >= 0 ? [f[4]] : []
  }),
  props: (f) => ({
    timeNs: f[0],
    ids: uint16(f[1]),
    shapes: f[2],
    sizes: Float32Array.from(uint16(f[3]), (mm) => mm / 1e3),
    colours: f[4],
    positions: metres(f[5]),
    turns: unpackQuaternions(f[6])
  }),
  stage: (f) => ({
    timeNs: f[0],
    characters: f[1].map(([character, revision]) => ({ character, revision }))
  }),
  status: (f) => ({
    edge: f[0],
    instance: f[1],
    revision: f[2],
    publishedNs: f[3],
    sensor: f[4] ?? "",
    phase: f[5] ?? "waiting",
    note: f[6] ?? "",
    fps: f[7] ?? 0,
    performers: f[10] ?? 0
  })
};
function readBody([id, joints, confidence]) {
  return { id, joints: metres(joints), confidence: fractions(confidence) };
}
function readCharacter(payload) {
  const map = decode(payload);
  const kind = map.held == null ? map.kind : "points";
  const vertices = float32(map.vertices);
  const pivots = float32(map.pivots);
  const edges = int32(map.edges);
  const count = vertices.length / 3;
  const isRigid = map.indices.length === 0;
  const weights = isRigid ? new Float32Array(4 * count) : float32(map.weights);
  if (isRigid) for (let vertex = 0; vertex < count; vertex++) weights[4 * vertex] = 1;
  return {
    id: map.id,
    revision: map.revision,
    kind,
    vertices,
    pivots,
    edges,
    faces: int32(map.faces),
    skinIndices: isRigid ? new Uint16Array(4 * count) : uint16(map.indices),
    skinWeights: weights,
    colours: map.colours ?? null,
    names: map.names ?? null,
    materials: map.materials == null ? null : readMaterials(map.materials),
    decoder: new PoseDecoder({ kind, pivots, edges })
  };
}
function readMaterials(map) {
  return {
    definitions: map.definitions,
    textures: map.textures.map(({ image, sampler }) => ({ image, sampler: sampler ?? "" })),
    of: int32(map.of),
    sets: map.sets,
    uvs: float32(map.uvs),
    tints: map.tints == null ? null : float32(map.tints)
  };
}
var float32 = (data) => new Float32Array(data.slice().buffer);
var int32 = (data) => new Int32Array(data.slice().buffer);
var uint16 = (data) => new Uint16Array(data.slice().buffer);
var metres = (data) => Float32Array.from(new Int16Array(data.slice().buffer), (steps) => steps * JOINT_STEP);
var fractions = (data) => Float32Array.from(data, (byte) => byte / 255);

// src/reader/skinning.ts
function writeMatrices(pose, pivots, out) {
  const { linear, positions } = pose;
  for (let j = 0; 3 * j < positions.length; j++) {
    for (let row = 0; row < 3; row++) {
      let offset = positions[3 * j + row];
      for (let column = 0; column < 3; column++) {
        const entry = linear[9 * j + 3 * row + column];
        out[16 * j + 4 * column + row] = entry;
        offset -= entry * pivots[3 * j + column];
      }
      out[16 * j + 12 + row] = offset;
    }
    out[16 * j + 3] = out[16 * j + 7] = out[16 * j + 11] = 0;
    out[16 * j + 15] = 1;
  }
}
function skinVertices(character, pose) {
  const { vertices, skinIndices, skinWeights, pivots } = character;
  const matrices = new Float32Array(16 * pivots.length / 3);
  writeMatrices(pose, pivots, matrices);
  const out = new Float32Array(vertices.length);
  for (let vertex = 0; 3 * vertex < vertices.length; vertex++) {
    const [x, y, z] = vertices.subarray(3 * vertex, 3 * vertex + 3);
    for (let row = 0; row < 3; row++) {
      let sum = 0;
      for (let k = 4 * vertex; k < 4 * vertex + 4; k++) {
        const m = 16 * skinIndices[k] + row;
        sum += skinWeights[k] * (matrices[m] * x + matrices[m + 4] * y + matrices[m + 8] * z + matrices[m + 12]);
      }
      out[3 * vertex + row] = sum;
    }
  }
  return out;
}
export {
  JOINT_COUNT,
  JOINT_PARENTS,
  OtherVersionError,
  PoseDecoder,
  VERSION,
  decodeColumns,
  readCharacter,
  readStream,
  skinVertices,
  spanningTree,
  splitStream,
  unpackQuaternions,
  writeMatrices
};
