"""A window that shows pictures, with nothing but Python's own toolkit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class Window:
    """A window on the desktop. It opens with its first picture; what a user closes stays closed."""

    def __init__(self, title: str):
        """Open nothing yet."""
        self._title = title
        self._root: Any = None
        self._label: Any = None
        self._picture: Any = None
        self._gone = False

    def open(self) -> None:
        """Open it.

        Raises:
            RuntimeError: there is no display, or Python came without Tk.
        """
        # Tk loads where a window is opened.
        try:
            import tkinter
        except ImportError as error:
            raise RuntimeError(
                'no window: this Python has no tkinter; install it, or use render_mode="rgb_array"'
            ) from error
        try:
            self._root = tkinter.Tk()
        except tkinter.TclError as error:
            raise RuntimeError(
                f'no display ({error}): use render_mode="rgb_array" instead of "human", or run under xvfb-run'
            ) from error
        self._root.title(self._title)
        self._root.resizable(False, False)
        self._label = tkinter.Label(self._root, borderwidth=0)
        self._label.pack()

    def show(self, rgb: NDArray[np.uint8]) -> None:
        """Show a picture (h, w, 3).

        Raises:
            RuntimeError: there is no display, or Python came without Tk.
        """
        if self._gone:
            return
        if self._label is None:
            self.open()
        label: Any = self._label
        import tkinter

        height, width, _ = rgb.shape
        try:
            data = b"P6 %d %d 255 " % (width, height) + np.ascontiguousarray(rgb).tobytes()
            self._picture = tkinter.PhotoImage(master=self._root, data=data, format="PPM")
            label.configure(image=self._picture)
            self._root.update()
        except tkinter.TclError:
            # Closed by hand: the episode goes on unseen.
            self._gone, self._root = True, None

    def close(self) -> None:
        """Close it; idempotent."""
        root, self._root, self._label, self._picture, self._gone = self._root, None, None, None, True
        if root is not None:
            import tkinter

            try:
                root.destroy()
            except tkinter.TclError:
                return
