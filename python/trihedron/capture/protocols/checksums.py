"""Checksums of common protocols, from their definitions."""

from __future__ import annotations

import binascii
import zlib
from collections.abc import Callable
from functools import reduce
from operator import xor

Checksum = Callable[[bytes], int]


def _crc8_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte << 1) ^ (0x07 if byte & 0x80 else 0)
        table.append(byte & 0xFF)
    return tuple(table)


def _reflected_table(polynomial: int) -> tuple[int, ...]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte >> 1) ^ (polynomial if byte & 1 else 0)
        table.append(byte)
    return tuple(table)


_CRC8, _MODBUS, _KERMIT = _crc8_table(), _reflected_table(0xA001), _reflected_table(0x8408)


def _crc8(data: bytes) -> int:
    crc = 0
    for byte in data:
        crc = _CRC8[crc ^ byte]
    return crc


def _reflected(data: bytes, table: tuple[int, ...], crc: int) -> int:
    for byte in data:
        crc = (crc >> 8) ^ table[(crc ^ byte) & 0xFF]
    return crc


CHECKSUM_OF: dict[str, Checksum] = {
    "sum8": lambda data: sum(data) & 0xFF,
    "sum8-zero": lambda data: -sum(data) & 0xFF,
    "xor8": lambda data: reduce(xor, data, 0),
    "sum16": lambda data: sum(data) & 0xFFFF,
    "crc8": _crc8,
    "crc16-ccitt": lambda data: binascii.crc_hqx(data, 0xFFFF),
    "crc16-modbus": lambda data: _reflected(data, _MODBUS, 0xFFFF),
    "crc16-kermit": lambda data: _reflected(data, _KERMIT, 0),
    "crc32": zlib.crc32,
}
"""Value of each kind over the covered bytes."""
