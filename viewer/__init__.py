"""The browser view: the scenes that pictures are painted of, live in a web page. It watches, and changes nothing."""
