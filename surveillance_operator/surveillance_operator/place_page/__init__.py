"""A place edited in a browser.

Begin with `edit_session`: what a person may ask and do there. `edit_command` serves it by itself,
`mission_page_node` beside a running mission; `dropped_map` makes a place of files that were
dropped on the page, which is `page/static/edit.js`.
"""
