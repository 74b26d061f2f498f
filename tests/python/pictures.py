# SPDX-License-Identifier: Apache-2.0
"""Reads the PNG files that our programs write: grey of 8 or 16 bits or colour of 8, by the standard library alone."""

import struct
import zlib

import numpy as np


def read_png(path):
    data = open(path, "rb").read()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, packed = 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        if kind == b"IHDR":
            width, height, bits, colour, _, _, interlace = struct.unpack(">IIBBBBB", body)
            assert colour in (0, 2) and interlace == 0 and bits in ((8, 16) if colour == 0 else (8,))
            channels = 3 if colour == 2 else 1
        elif kind == b"IDAT":
            packed += body
        at += 12 + length
    size = bits // 8 * channels
    stride = width * size
    raw = zlib.decompress(packed)
    rows = np.zeros((height, stride), np.uint8)
    before = np.zeros(stride, np.int32)
    for y in range(height):
        kind = raw[y * (stride + 1)]
        line = np.frombuffer(raw, np.uint8, stride, y * (stride + 1) + 1).astype(np.int32)
        if kind == 2:
            line = (line + before) & 255
        elif kind:  # of the left neighbour too: one after the other
            out = np.zeros(stride, np.int32)
            for x in range(stride):
                left = out[x - size] if x >= size else 0
                up, corner = before[x], before[x - size] if x >= size else 0
                if kind == 1:
                    guess = left
                elif kind == 3:
                    guess = (left + up) // 2
                else:
                    p = left + up - corner
                    near = (abs(p - left), abs(p - up), abs(p - corner))
                    guess = (left, up, corner)[near.index(min(near))]
                out[x] = (line[x] + guess) & 255
            line = out
        rows[y] = before = line
    if bits == 16:
        return rows.view(">u2").astype(np.uint16).reshape(height, width)
    return rows.reshape((height, width, 3) if channels == 3 else (height, width))
