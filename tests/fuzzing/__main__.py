"""Print what the last full run counted, and write the page."""

from .table import PAGE, render

if __name__ == "__main__":
    PAGE.write_text(render(), encoding="utf-8")
    print(render())
