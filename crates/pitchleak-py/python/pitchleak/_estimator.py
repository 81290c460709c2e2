"""Live: samples in, estimates out."""

from typing import Any, Self

from . import _arguments, _inputs, _pitchleak
from ._pitchleak import Rig
from ._report import Report, parse


class Estimator(_pitchleak.Estimator):
    """The estimator of :func:`replay` for a trace that comes bit by bit.

    :meth:`update` takes one sample or arrays of samples in SI, :meth:`extend` anything that ``replay``
    takes, :meth:`state` gives the report as it stands. However the trace is cut, the numbers are those of
    ``replay`` on the whole, to the last bit. An estimator may be used from several threads, each call at a
    time.

    ``rig`` is a :class:`Rig` or the path of a rig file, the built-in one where left out; ``columns`` names foreign
    columns as for ``replay``; ``estimator`` is ``rls`` or ``paper``; ``strict`` makes bad samples raise
    instead of being skipped.

    >>> import pitchleak as pl
    >>> trace = pl.simulate(wind=13, leak_external_a="0.5 L/min", duration=10)
    >>> est = pl.Estimator(pl.Rig.paper())
    >>> est.extend(trace.columns)
    19
    >>> est.state().estimates == pl.replay(trace.columns).estimates
    True
    >>> pl.Estimator.from_bytes(est.saved()).state() == est.state()
    True
    """

    def __new__(
        cls,
        rig: Rig | _inputs.Path | None = None,
        *,
        columns: _inputs.Columns | None = None,
        estimator: str | None = None,
        strict: bool = False,
    ) -> Self:
        if estimator is not None:
            estimator = _arguments.word("estimator", estimator, "rls or paper")
        strict = _arguments.flag("strict", strict)
        return super().__new__(cls, _inputs.rig_for(None, rig, columns), estimator=estimator, strict=strict)

    def extend(self, data: Any) -> int:
        """Takes in the next part of the trace, with columns as :func:`replay` takes them.

        Returns how often the estimates were renewed. A column ``timestamp`` counts from its first time in
        the first part.
        """
        return self.extend_source(_inputs.source(data, self.rig, self.epoch_ns))

    def state(self) -> Report:
        """The report as it stands. Raises ``ValueError`` before the first sample."""
        report = self.report()
        if report is None:
            raise ValueError("no sample yet")
        return parse(Report, *report)

    @classmethod
    def load(cls, path: _inputs.Path) -> "Estimator":
        """The estimator that :meth:`save` wrote. Raises ``ValueError`` where the file is none."""
        with open(path, "rb") as file:
            return cls.from_bytes(file.read())

    @classmethod
    def from_bytes(cls, saved: bytes) -> "Estimator":
        """The estimator that gave these bytes as ``saved()``."""
        estimator = cls(cls.saved_rig(saved))
        estimator.restore(saved)
        return estimator

    def __reduce__(self) -> tuple[Any, tuple[bytes]]:
        return type(self).from_bytes, (self.saved(),)

    def __repr__(self) -> str:
        time_s = self.time_s
        when = "no sample yet" if time_s is None else f"at {time_s:.3f} s"
        return f"<Estimator of rig {self.rig.name}, {when}>"
