"""Rules of a machine whose drives err: see ``drives``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .core import Array, OutcomeT, PlanT, Rows
from .drives import DriveLuck, Servos, draw_luck, whole_luck
from .field import FieldT
from .kernel_core import KernelCore


class ErringCore(KernelCore[PlanT, OutcomeT]):
    """A core whose machine's drives may err. Without errors it is a ``KernelCore`` and nothing else.

    With errors a decision takes its steps one by one: where a mechanism's tool is for joints that are off is no kernel.
    A subclass calls ``_drive`` in its constructor, says ``tool_error``, adds it in ``nominal``, and hands the machines'
    luck on: its batches have it as ``luck``, its fields as ``drives``.

    Attributes:
        servos: errors by driven joint.
        drive_luck: (B, J) of the worlds' machines; J is 0 without errors.
    """

    servos: Servos
    drive_luck: Array

    def _drive(self, servos: Servos) -> None:
        """Take the errors of the machine's drives."""
        self.servos = servos
        self.errs = self.stepwise = servos.on
        self.drive_luck = np.zeros((self.worlds, len(servos.encoder) if self.errs else 0))

    @property
    def joints(self) -> int:
        """How many numbers of luck a machine has: one a driven joint, none without errors."""
        return self.drive_luck.shape[1]

    def tool_error(self, plan: PlanT) -> Array:
        """Where the tool really is at its work less where it was sent, (B, coordinates); of a machine that errs."""
        raise NotImplementedError

    def draw_luck(self, generators: Sequence[np.random.Generator]) -> Array | None:
        """Luck of the machines that play drawn fields, before anything else is drawn; None without errors."""
        return draw_luck(generators, self.joints) if self.errs else None

    def luck_of(self, fields: Sequence[Any]) -> Array | None:
        """Luck of the machines that play fields in which nothing is missing."""
        return np.stack([field.drives.encoder for field in fields]) if self.errs else None

    def with_luck(self, fields: Sequence[FieldT], luck: Array | None) -> list[FieldT]:
        """The fields of a batch with the luck of their machines."""
        if luck is None:
            return list(fields)
        pairs = zip(fields, luck, strict=True)
        return [replace(field, drives=DriveLuck(one.copy())) for field, one in pairs]  # type: ignore[call-arg]

    def with_whole_luck(self, field: FieldT, given: DriveLuck | None, generator: np.random.Generator) -> FieldT:
        """A field with the luck of its machine, drawn where a file does not say it."""
        return replace(field, drives=whole_luck(given, generator, self.joints))  # type: ignore[call-arg]

    def take_luck(self, rows: Rows, luck: Array | None) -> None:
        """Let the machines of ``rows`` have their luck (R, J)."""
        if luck is not None:
            self.drive_luck[rows] = luck
