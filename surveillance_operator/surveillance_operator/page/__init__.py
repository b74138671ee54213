"""The live page of a mission: its server, and what it serves.

Begin with `server`, whose routes say what each address answers. `broadcaster` passes the page's
parts (`page_state`) on to any number of viewers. The page itself is in `static`: `main.js` follows
the stream and hands each part to the module of its section.
"""
