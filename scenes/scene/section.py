"""What every section of a scene is: keys that are known, values that do not change, marks of keys that name files."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

__all__ = [
    "BODY_FILE",
    "DRAFT_FILE",
    "MEASURED_FILE",
    "MOTION_FILE",
    "PATTERN_FILE",
    "PICTURE_FILE",
    "PRIMITIVES_FILE",
    "SPRITE_FILE",
    "NamesFile",
    "Positive",
    "Section",
    "Share",
]


class Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0, le=1)]


@dataclass(frozen=True)
class NamesFile:
    """Marks a key whose text is the path of a file, or may be one: then it has one of these endings. What follows of it
    (`scene_files`) are where the path is taken from, and that --resume sees when the file was changed."""

    endings: tuple[str, ...] = ()

    def fits(self, text: str) -> bool:
        """Whether the text is the path of a file."""
        return not self.endings or text.lower().endswith(self.endings)


DRAFT_FILE = NamesFile((".wif",))
SPRITE_FILE = NamesFile((".png",))
PATTERN_FILE = NamesFile((".json", ".dxf"))
PICTURE_FILE = NamesFile()
MEASURED_FILE = NamesFile()
BODY_FILE = NamesFile((".obj", ".ply", ".glb", ".stl"))
MOTION_FILE = NamesFile((".bvh", ".npz"))
PRIMITIVES_FILE = NamesFile()
