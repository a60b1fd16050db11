"""A frame of the fetus's head, its maps, and what surrounds them: python first_frame.py [DIRECTORY]"""

import sys
from pathlib import Path

import insonify


def main(directory: Path) -> None:
    """Renders the head and says what is in the picture."""
    station = insonify.Station.obstetric()
    head = station.planes["head"]
    frame = station.render(head.pose, quality="balanced")
    directory.mkdir(parents=True, exist_ok=True)
    print(frame, frame.save_png(directory / "head.png"))
    for name in ("brain", "calvaria_fetal"):
        if name in frame.tissues:
            square_mm = float(frame.tissue(name).sum()) * frame.mm_per_pixel**2
            print(f"{name}: {square_mm / 100:.1f} cm2")
    print(f"{head.title}: off by {head.offset(frame.pose).angle_deg:.1f} degrees")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/python"))
