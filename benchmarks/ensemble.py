"""The loop that sweeps run, its criteria included: members side by side; and MuJoCo's `rollout` on the same members."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from benchmarks.case import Case, Effort, Missing
from benchmarks.scenes import STEP_SIZE, scene_of
from stiffdice.dynamics.state import Ensemble
from stiffdice.errors import NotInstalledError
from stiffdice.scene.scene import Scene
from stiffdice.simulation.engines.registry import adapter_of
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.run import simulate

# Floating-point operations of one computed step of one member, a flat cube where the model does not turn it: each sum,
# difference, product, quotient, square root and maximum is one, and so two where they are fused; signs, comparisons,
# choices and moves are none (what Intel's counters FP_ARITH_INST_RETIRED count). They are those of the compiled loop,
# counted in it by its test: the step, and what the criteria look at.
FLOPS = {
    (model, law): flops
    for model, flops in {"vertical": 46, "sliding": 70, "tumbling": 461}.items()
    for law in ("ungated", "gated")
}

MEMBERS = 64  # of a sweep's block

_HOLDS = {
    "vertical": "comparisons and selections, which use the same units and are not counted",
    "sliding": "a root and a quotient, and comparisons and selections",
    "tumbling": "roots and quotients of eight nodes, for which a vector unit takes many cycles",
}


def cases(effort: Effort) -> Iterator[Case | Missing]:
    """Yield every model under both laws, and MuJoCo's rollout of the same members under the gated one."""
    count = min(MEMBERS, 8 * effort.members)
    steps = effort.steps
    for (model, law), flops in FLOPS.items():
        scene = scene_of(law, steps)
        members = phased(scene, model, steps, count, turned(scene, model, count))

        def run(scene: Any = scene, model: str = model, members: Ensemble = members) -> Any:
            return simulate(scene, model=model, steps=steps, members=members)

        share = float(run().steps_computed.sum()) / (count * steps)
        yield Case(
            f"ensemble_{model}_{law}",
            f"{count} members, {model}, {law}: the loop of sweeps, {share:.2%} of the steps computed",
            "step",
            count * steps,
            lambda run=run: run,  # type: ignore[misc]
            effort.rounds,
            _HOLDS[model],
            flops * share,
        )
        if law == "gated":
            yield _rollout(model, members, max(1, steps // 50), effort)


def _rollout(model: str, members: Ensemble, steps: int, effort: Effort) -> Case | Missing:
    """Return MuJoCo's own loop over members, which keeps every state, for the first part of their flight."""
    name, scene = f"mujoco_rollout_{model}_gated", scene_of("gated", steps)
    try:
        adapter = adapter_of("mujoco")
    except NotInstalledError as error:
        return Missing(name, f"MuJoCo: {str(error).splitlines()[0]}")
    count = len(members.launches)
    return Case(
        name,
        f"{count} members, {model}, gated: MuJoCo's rollout, the first {steps * STEP_SIZE:g} s",
        "step",
        count * steps,
        lambda: rolling(adapter, scene, model, members, steps),
        effort.slow,
        "a general engine: collisions are looked for and a solver is called every step",
        version=adapter.version(),
    )


def rolling(
    adapter: Any, scene: Scene, model: str, members: Ensemble, steps: int, h: float = STEP_SIZE, threads: int = 1
) -> Callable[[], object]:
    """Return what takes so many steps of h [s] of each member with MuJoCo's rollout."""
    from mujoco import MjData, mj_getState, mj_stateSize, mjtState, rollout

    standing = [adapter(scene, model, members.launches[k : k + 1], h) for k in range(len(members.launches))]
    models, kind = [engine._model for engine in standing], mjtState.mjSTATE_FULLPHYSICS
    states = np.empty((len(standing), mj_stateSize(models[0], kind)))
    for engine, state in zip(standing, states, strict=True):
        mj_getState(engine._model, engine._data, state, kind)
    data = [MjData(models[0]) for _ in range(threads)]
    return lambda: rollout.rollout(models, data, states, nstep=steps)
