"""A page's elements as they were written, closed in order or not."""

from html.parser import HTMLParser


class Tree(HTMLParser):
    """Checks that elements are closed in order; keeps every element's attributes and the texts of table cells."""

    VOID = ("meta", "br", "hr", "img", "input", "link")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.ids: list[str] = []
        self.rows: list[tuple[str, str, list[str]]] = []  # section, policy, values
        self.section = ""
        self.text: str | None = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.elements.append((tag, found))
        if "id" in found:
            self.ids.append(str(found["id"]))
        if tag == "section":
            self.section = str(found["id"])
        if tag == "tr" and "data-policy" in found:
            self.rows.append((self.section, str(found["data-policy"]), []))
        if tag in ("span", "b") and "td" in self.open and self.open[-1] == "td":
            self.text = ""
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        if self.text is not None:
            self.text += data

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-3:]}"
        self.open.pop()
        if self.text is not None and tag in ("span", "b"):
            self.rows[-1][2].append(self.text) if self.rows else None
            self.text = None
