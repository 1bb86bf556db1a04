"""Listens to the stages and shows what they did: `Dump` writes pictures and numbers into a folder."""

from panostitch.debug.dump import Dump

__all__ = ["Dump"]
