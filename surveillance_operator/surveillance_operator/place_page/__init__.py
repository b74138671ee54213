"""The place on the page, to be edited: what the browser is shown, and what it may ask for."""
