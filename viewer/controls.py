"""Controls that both people and the desk set: what a page asks for is never set back while it waits to be done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any


class Control:
    """A list or a number of the page.

    A page's messages arrive in the server's event loop; what they ask for is done later, in the viewer's loop. Between
    the two the control already has the wished value and what is played has not. So wishes are read, and values are set,
    in the event loop alone: whatever the viewer's loop has shown meanwhile is dropped where a wish waits.
    """

    def __init__(
        self,
        handle: Any,
        loop: Any,
        order: Callable[[Callable[[], None]], None],
        take: Callable[[Any], None] | None = None,
    ):
        """Listen to it.

        Args:
            handle: viser's.
            loop: the server's event loop.
            order: has something done in the viewer's loop.
            take: takes a value that a person has set, there; of several that wait the last.
        """
        self._handle, self._loop, self._order, self._take = handle, loop, order, take
        # The event loop alone counts wishes, the viewer's loop alone what was served.
        self._wished = self._served = 0
        self._shown: tuple[Any, ...] | None = None
        if take is not None:
            handle.on_update(self._hear)

    @property
    def value(self) -> Any:
        """As the page has it."""
        return self._handle.value

    def show(self, value: Any, options: Sequence[str] | None = None) -> None:
        """Set it, and what there is to choose from, soon."""
        self._loop.call_soon_threadsafe(self._set, value, options)

    def offer(self, value: Any, options: Sequence[str]) -> None:
        """As ``show``, where something else is offered than the last time: a person's choice among the same stays."""
        if self._shown != (offered := (value, *options)):
            self._shown = offered
            self.show(value, options)

    def renew(self) -> None:
        """Have the next offer shown even if it is the same."""
        self._shown = None

    def _set(self, value: Any, options: Sequence[str] | None) -> None:
        if options is not None and tuple(self._handle.options) != tuple(options):
            self._handle.options = options
        if self._wished == self._served and self._handle.value != value:
            self._handle.value = value

    async def _hear(self, event: Any) -> None:
        # What the desk sets itself is nobody's wish.
        if event.client is None:
            return
        self._wished += 1
        value, wish = self._handle.value, self._wished
        self._order(lambda: self._serve(value, wish))

    def _serve(self, value: Any, wish: int) -> None:
        self._served = wish
        if wish == self._wished and self._take is not None:
            self._take(value)
