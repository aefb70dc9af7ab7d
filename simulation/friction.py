"""Friction of drives: dry friction is taken off what a motor can give, viscous friction brakes its joint."""

from __future__ import annotations

from ..kernels.config import Config


def below_limit(parameters: Config, friction: str, limit: str, unit: str) -> None:
    """Refuse parameters whose dry friction leaves a motor nothing."""
    most = getattr(parameters, limit)
    if getattr(parameters, friction) >= most:
        parameters.refuse(friction, f"give less than {limit} = {most:g} {unit}")
