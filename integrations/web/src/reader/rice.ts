/**
 * Rice codes: small signed integers in few bits, column by column.
 *
 * Each column starts with 4 bits, its parameter k. The value 15 means that all numbers of the column are 0, and
 * that no bits follow. Every other number is q ones, a zero, and k low bits, which give u = (q << k) | low bits.
 * Twelve ones instead are followed by u itself in 22 bits. The number is u / 2 for an even u, otherwise
 * -(u + 1) / 2. The bits of a byte are read from the most significant one.
 */

const PARAMETER_BITS = 4;
const ALL_ZERO = 15;
/** The number of consecutive ones that announce a raw number. */
const ESCAPE = 12;
const ESCAPE_BITS = 22;

/** A cursor over the bits of some bytes. Reads beyond the end throw a RangeError. */
class BitReader {
  private at = 0;

  constructor(private readonly data: Uint8Array) {}

  /** Returns the next `count` bits, at most 22, as an unsigned integer. */
  read(count: number): number {
    if (this.at + count > 8 * this.data.length) throw new RangeError("the coded numbers are truncated");
    let value = 0;
    for (let remaining = count; remaining > 0; ) {
      const available = 8 - (this.at & 7);
      const width = Math.min(available, remaining);
      const bits = (this.data[this.at >> 3] >> (available - width)) & ((1 << width) - 1);
      value = (value << width) | bits;
      this.at += width;
      remaining -= width;
    }
    return value;
  }

  /** Throws a RangeError unless fewer than 8 bits remain, all of them 0. */
  expectEnd(): void {
    const remaining = 8 * this.data.length - this.at;
    if (remaining >= 8 || this.read(remaining) !== 0) throw new RangeError("bytes follow the coded numbers");
  }
}

/**
 * Returns a table of integers, row by row.
 *
 * Throws a RangeError for truncated bytes, and for bytes that follow the table.
 */
export function decodeColumns(data: Uint8Array, rows: number, columns: number): Int32Array {
  const table = new Int32Array(rows * columns);
  const bits = new BitReader(data);
  for (let column = 0; column < columns; column++) {
    const parameter = bits.read(PARAMETER_BITS);
    if (parameter === ALL_ZERO) continue;
    for (let row = 0; row < rows; row++) {
      let quotient = 0;
      while (quotient < ESCAPE && bits.read(1) === 1) quotient++;
      const folded =
        quotient < ESCAPE ? bits.read(parameter) | (quotient << parameter) : bits.read(ESCAPE_BITS);
      table[row * columns + column] = folded & 1 ? -(folded >> 1) - 1 : folded >> 1;
    }
  }
  bits.expectEnd();
  return table;
}
