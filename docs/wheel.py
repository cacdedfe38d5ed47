"""Build the wheel of a release in dist/: that of hatchling, its files compressed by Zopfli, which writes what every unzip reads.

python docs/wheel.py
"""

from __future__ import annotations

import struct
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOCAL, CENTRAL, END = "<4s5H3L2H", "<4s6H3L5H2L", "<4s4H2LH"  # records of a zip archive


def compressed(wheel: Path, effort: int = 15) -> bytes:
    """The same archive, with the same files, names, dates and modes, in fewer bytes.

    Parameters
    ----------
    wheel : Path
    effort : int
        Iterations of Zopfli for each file.
    """
    from zopfli.zopfli import compress

    body, directory, count = bytearray(), bytearray(), 0
    with zipfile.ZipFile(wheel) as archive:
        for member in archive.infolist():
            data, name = archive.read(member), member.filename.encode()
            small = compress(data, numiterations=effort)[2:-4]  # the zlib container around the deflated data: 2 and 4 bytes
            year, month, day, hour, minute, second = member.date_time
            date, time = (year - 1980) << 9 | month << 5 | day, hour << 11 | minute << 5 | second // 2
            common = (20, 1 << 11, zipfile.ZIP_DEFLATED, time, date, member.CRC, len(small), len(data), len(name), 0)
            directory += struct.pack(
                CENTRAL, b"PK\1\2", 3 << 8 | 20, *common, 0, 0, 0, member.external_attr, len(body)
            ) + name  # fmt: skip
            body += struct.pack(LOCAL, b"PK\3\4", *common) + name + small
            count += 1
    return bytes(body + directory + struct.pack(END, b"PK\5\6", 0, 0, count, count, len(directory), len(body), 0))


def main() -> None:
    from hatchling.builders.wheel import WheelBuilder

    for name in WheelBuilder(str(ROOT)).build(directory=str(ROOT / "dist"), versions=["standard"]):
        wheel = Path(name)
        data = compressed(wheel)
        wheel.write_bytes(data)
        print(f"{wheel}: {len(data)} bytes")


if __name__ == "__main__":
    main()
