"""The two colour spaces of glTF: textures are sRGB, factors and vertex colours are linear (IEC 61966-2-1)."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, UInt8, UInt16


def linear_from_srgb(srgb: UInt8) -> Float:
    """Returns linear light 0..1 from sRGB bytes, in the same shape."""
    coded = srgb / 255.0
    return np.asarray(np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4))


def srgb_from_linear(linear: Float) -> UInt8:
    """Returns sRGB bytes from linear light 0..1, in the same shape. Values outside of 0..1 are clamped, and
    NaN becomes black."""
    linear = np.clip(np.nan_to_num(linear), 0.0, 1.0)
    coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(coded * 255).astype(np.uint8)


def linear16_from_srgb(srgb: UInt8) -> UInt16:
    """Returns (V, 4) linear opaque colours of 16 bits: 8 bits would cause banding in dark colours."""
    linear = linear_from_srgb(srgb)
    opaque = np.concatenate([linear, np.ones((len(linear), 1))], 1)
    return np.round(opaque * 65535).astype(np.uint16)
