"""Writes PNG files with the standard library alone."""

import struct
import zlib


def write(path, rgba8):
    """Writes an (H, W, 4) array of uint8, colour not premultiplied, to `path`."""
    height, width, _ = rgba8.shape

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    # Eight bits a channel, RGBA, no interlace; each row begins with filter 0.
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    rows = b"".join(b"\0" + row.tobytes() for row in rgba8)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"sRGB", b"\0")
    data += chunk(b"IDAT", zlib.compress(rows, 6)) + chunk(b"IEND", b"")
    with open(path, "wb") as file:
        file.write(data)
