"""`stiffdice ground`: from a restitution to stiffness, damping and step, and back."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING, Any

from stiffdice.cli import common, grammar
from stiffdice.cli.terminal import output
from stiffdice.errors import InputError

if TYPE_CHECKING:
    from stiffdice.advice.contact_design import Contact

HELP = "turn what is known of a bounce into a ground, and into what other engines are told"
EXAMPLES = """\
examples:
  stiffdice ground --restitution 0.5 --mass '4 g' --side '16 mm' --drop '30 cm' --depth '0.1 mm'
  stiffdice ground --restitution 0.5 --mass '4 g' --side '16 mm' --speed '2 m/s' --contact-time '0.2 ms' --quick
  stiffdice ground --stiffness '10 kN/m' --damping '2 kg/s' --mass '4 g' --side '16 mm' --speed 2 --quick
  stiffdice ground --restitution 0.5 --mass '4 g' --side '16 mm' --speed 2 --depth '0.1 mm' --engine mujoco
  stiffdice ground --material

A ground is told by how it bounces (--restitution, --material or --damping) and by how hard it is (--depth,
--contact-time or --stiffness), of a cube that lands flat. What is printed after `ground:` can be pasted into a scene.
Longest steps are measured in some seconds; --quick leaves them out. --engine adds what to paste into an engine, the
restitution predicted at each timestep and, where the engine is installed, measured (docs/how-to/ground.md).
"""

# Options that are numbers: what they are, unless other commands have that option, too; and their unit.
_GIVEN = {
    "restitution": ("", "1"),
    "damping": (", beside --stiffness", "kg/s"),
    "stiffness": ("", "kg/s²"),
    "contact_time": ("", "s"),
    "depth": ("the deepest penetration [m]", "m"),
}
_CUBE = {
    "mass": ("", "kg"),
    "side": ("", "m"),
    "speed": ("at which it lands [m/s]", "m/s"),
    "drop": ("the height from which it falls, in place of a speed [m]", "m"),
}
GRAVITY = 9.8


def add(ground: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    for name, (told, _) in (_GIVEN | _CUBE).items():
        option = f"--{name.replace('_', '-')}"
        if option in grammar.OPTIONS:
            grammar.add(ground, option, told)
        else:
            ground.add_argument(option, metavar="X", help=told)
    grammar.add(ground, "--gravity", f" (default: {GRAVITY:g})", default=str(GRAVITY))
    grammar.add(ground, "--contact", " (default: gated)", default="gated")
    told = "a measured restitution by its name; without a name, the table of them with sources"
    ground.add_argument("--material", nargs="?", const="", metavar="MATERIAL", help=told)
    ground.add_argument("--engine", metavar="ENGINE", help="mujoco, pybullet or drake: what to paste into it")
    grammar.add(
        ground, "--dt", ", with --engine: what to paste is for it (default: the longest that keeps e within 5 %%)"
    )
    ground.add_argument("--quick", action="store_true", help="leave out the longest steps of our schemes")
    grammar.add_form(ground)


def call(options: argparse.Namespace) -> None:
    """Print the ground."""
    from stiffdice.advice.materials import MATERIALS

    if options.material == "":
        if options.json:
            output.say_json({name: found._asdict() for name, found in MATERIALS.items()})
            return
        from stiffdice.report import ground_page

        output.say(ground_page.material_lines())
        return
    contact = _contact(options)
    timestep = None if options.dt is None else common.number("--dt", options.dt, "s", above=0)
    if timestep is not None and options.engine is None:
        raise InputError("--dt: allowed is beside --engine only")
    lines, data = _told(options, contact, timestep)
    if options.json:
        output.say_json(data)
    else:
        output.say(lines)


def _contact(options: argparse.Namespace) -> Contact:
    """Return the contact that the options tell; raises InputError."""
    from stiffdice.advice import contact_design, materials

    given = _numbers(options, _GIVEN)
    if options.material is not None:
        if "restitution" in given or "damping" in given:
            raise InputError("--material: is a restitution; give no other, and no --damping")
        given["restitution"] = materials.material(options.material).restitution
    cube = _numbers(options, _CUBE, above=0)
    gravity = common.number("--gravity", options.gravity, "m/s²")
    for name in ("mass", "side"):
        if name not in cube:
            raise InputError(f"--{name}: is needed")
    if ("speed" in cube) == ("drop" in cube):
        raise InputError("--speed and --drop: needed is one of them")
    if "drop" in cube and options.contact == "ungated":
        raise InputError("--drop: allowed with --contact gated, as ungated ground brakes a cube in the air; or --speed")
    if "drop" in cube and not gravity > 0:
        raise InputError(f"--gravity = {gravity:g}: allowed beside --drop is a number > 0 [m/s²]")
    speed = cube["speed"] if "speed" in cube else math.sqrt(2 * gravity * cube["drop"])
    return contact_design.designed(
        given, mass=cube["mass"], side=cube["side"], speed=speed, gravity=gravity, law=options.contact
    )


def _numbers(options: argparse.Namespace, wanted: dict[str, tuple[str, str]], **bounds: Any) -> dict[str, float]:
    """Return the numbers of those options that are given, in SI units."""
    texts = {name: getattr(options, name) for name in wanted}
    return {
        name: common.number(f"--{name.replace('_', '-')}", text, wanted[name][1], **bounds)
        for name, text in texts.items()
        if text is not None
    }


def _told(options: argparse.Namespace, contact: Contact, timestep: float | None) -> tuple[list[str], dict[str, Any]]:
    """Return what to print, as lines and as data."""
    from stiffdice.advice import engine_ladder, engine_parameters, step_limits
    from stiffdice.cli.terminal.progress import trials
    from stiffdice.report import ground_page
    from stiffdice.scene import validation

    lines, data = ground_page.contact_lines(contact), contact.as_data() | {"ground": contact.ground()}
    engine = options.engine and validation.choice("--engine", options.engine, engine_parameters.ENGINES)
    if engine:
        engine_parameters.check(contact)
    if engine or not options.quick:
        step_limits.check(contact)
    with trials("ground: measuring") as tell:
        if not options.quick:
            limits = {}
            for number, scheme in enumerate(step_limits.FIXED):
                tell(scheme, number / len(step_limits.FIXED))
                limits[scheme] = step_limits.limits(contact, scheme)
            lines += ["", *ground_page.limit_lines(limits, contact)]
            data["longest_steps_s"] = ground_page.limits_as_data(limits)
        if engine:
            tell(engine)
            ladder = engine_ladder.climbed(engine, contact, timestep)
            h = timestep or ladder.recommended(contact)
            told = engine_parameters.parameters(engine, contact, h)
            lines += ["", *ground_page.ladder_lines(ladder, contact), "", *ground_page.paste_lines(engine, told, h)]
            data["engine"] = ground_page.ladder_as_data(ladder, contact)
            data["parameters"] = told.values | {"paste": told.paste, "notes": told.notes}
    return lines, data
