"""Routes of the beware list: its edits, their preview, and what was detected."""
