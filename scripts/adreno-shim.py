#!/usr/bin/env python3
"""Turns the shim's Adreno 740 into the Quest 3's variant of it: chip 0x43050b00 and, as the real kernel reports, no model number.

    patch-shim.py SHIM PATCHED
"""

import struct
import sys

GMEM_BYTES = 3 << 20
PHONE = struct.pack("<QII", 0x43050A01, 740, GMEM_BYTES)
QUEST_3 = struct.pack("<QII", 0x43050B00, 0, GMEM_BYTES)

shim, patched = sys.argv[1:]
with open(shim, "rb") as source:
    code = source.read()
if code.count(PHONE) != 1:
    sys.exit(f"{shim} has {code.count(PHONE)} rows for the Adreno 740, not one")
with open(patched, "wb") as target:
    target.write(code.replace(PHONE, QUEST_3))
