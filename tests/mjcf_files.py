"""Small MuJoCo models, written as strings."""

from __future__ import annotations

from pathlib import Path

LINEAR = 'solref="-20000 -20" solimp="0.9 0.9 0.001 0.5 2"'


def scene(bodies: str, contact: str = LINEAR, option: str = 'timestep="0.001"', more: str = "") -> str:
    """Return a model: a floor, and bodies on it."""
    return f"""<mujoco>
  <option {option}/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" {contact}/>
    {bodies}
  </worldbody>
  {more}
</mujoco>
"""


def body(shape: str, contact: str = LINEAR, name: str = "it", place: str = 'pos="0 0 1"') -> str:
    """Return a free body of one geom."""
    return f'<body name="{name}" {place}><freejoint/><geom {shape} {contact}/></body>'


def ball(contact: str = LINEAR, option: str = 'timestep="0.001"') -> str:
    """Return a model of a ball of 0.1 m radius on a floor, both with the same contact."""
    return scene(body('name="ball" type="sphere" size="0.1"', contact), contact, option)


def written(text: str, folder: Path, name: str = "model.xml") -> Path:
    """Return a file that holds a text."""
    (folder / name).write_text(text)
    return folder / name
