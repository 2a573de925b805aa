"""The program of the example ``camera_pick``, which asks for a photo and goes to the part that was found."""

from pathlib import Path

EXAMPLE = Path(__file__).parents[1] / "examples" / "camera_pick.py"

PROGRAM = EXAMPLE.read_text(encoding="utf-8").split('PROGRAM = """')[1].split('"""')[0]
