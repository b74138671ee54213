"""The zones of a place as the masks of Nav2's costmap filters.

Nav2's keepout and speed filters read a mask, a map in map_server's format, and a CostmapFilterInfo
that says how its values are meant (docs.nav2.org, "Navigating with Keepout Zones", "... with Speed
Limits"). The masks have the place's own cells and `mode: raw`, in which a pixel is the value
itself. The parameters are written beside them: those of the servers that publish both, and of the
costmaps and the controller that read them. A costmap's node has a namespace of its own, so that
names of topics which it shares with the servers are absolute.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from floor_plans.floor_plan import FloorPlan
from floor_plans.occupancy_grid import OCCUPIED, Grid
from strict_files.files import FileError, in_one_line

KEEP_OUT, SPEED = 'keepout', 'speed'
_KEEP_OUT_TYPE, _SPEED_TYPE = 0, 2
"""As CostmapFilterInfo has them: keepout zones; speed limits in m/s."""
PARAMETERS, _VALUES = 'costmap_filters.yaml', 'ros__parameters'


def keep_out_mask(plan: FloorPlan, grid: Grid) -> NDArray[np.uint8]:
    """Return 100 for the cells of keep-out zones, 0 for all others; row 0 in the south."""
    mask = np.zeros(grid.cells.shape, np.uint8)
    for zone in plan.zones.keep_out.values():
        mask[zone.cells_on(grid)] = OCCUPIED
    return mask


def speed_mask(plan: FloorPlan, grid: Grid) -> tuple[NDArray[np.uint8], float]:
    """Return the cells' speed limits as whole numbers from 1, and how many m/s 1 is.

    0 is no limit. A speed is rounded down, and where zones overlap the lower one counts.
    """
    speeds = {name: zone.speed or 0.0 for name, zone in plan.zones.slow.items()}
    unit = max(speeds.values(), default=1.0) / OCCUPIED
    mask = np.zeros(grid.cells.shape, np.uint8)
    for name, zone in sorted(plan.zones.slow.items(), key=lambda each: -speeds[each[0]]):
        mask[zone.cells_on(grid)] = max(1, int(speeds[name] / unit + 1e-6))
    return mask, unit


def write_filter_masks(plan: FloorPlan, folder: Path) -> list[Path]:
    """Write the masks of a place's zones, and the parameters of who publishes and reads them.

    Args:
        plan: The place.
        folder: Where to; it is made if it is not there.

    Returns:
        The YAML files written: a mask for each kind of zone that the place has, and the parameters.

    Raises:
        FileError: They cannot be written.
    """
    grid = plan.grid()
    written = []
    parameters: dict[str, Any] = {}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if plan.zones.keep_out:
            written.append(_write(folder, KEEP_OUT, keep_out_mask(plan, grid), grid))
            parameters |= _servers(written[-1], KEEP_OUT, _KEEP_OUT_TYPE, 1.0)
        if plan.zones.slow:
            mask, unit = speed_mask(plan, grid)
            written.append(_write(folder, SPEED, mask, grid))
            parameters |= _servers(written[-1], SPEED, _SPEED_TYPE, unit)
        parameters |= _readers(bool(plan.zones.keep_out), bool(plan.zones.slow))
        path = folder / PARAMETERS
        path.write_text(yaml.safe_dump(parameters, sort_keys=False), 'utf-8')
    except OSError as error:
        raise FileError(in_one_line(error)) from None
    return [*written, path]


def _write(folder: Path, kind: str, mask: NDArray[np.uint8], grid: Grid) -> Path:
    from PIL import Image

    path = folder / f'{kind}_mask.yaml'
    Image.fromarray(np.ascontiguousarray(mask[::-1])).save(path.with_suffix('.pgm'))
    x, y = (round(each, 7) for each in grid.origin)
    path.write_text(
        f'image: {kind}_mask.pgm\nmode: raw\nresolution: {grid.resolution:g}\n'
        f'origin: [{x}, {y}, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n',
        'utf-8',
    )
    return path


def _servers(mask: Path, kind: str, number: int, multiplier: float) -> dict[str, Any]:
    topic = f'/{kind}_filter_mask'
    server = {'yaml_filename': str(mask.resolve()), 'topic_name': topic, 'frame_id': 'map'}
    info = {'type': number, 'filter_info_topic': _info(kind), 'mask_topic': topic}
    info |= {'base': 0.0, 'multiplier': multiplier}
    return {
        f'{kind}_filter_mask_server': {_VALUES: server},
        f'{kind}_costmap_filter_info_server': {_VALUES: info},
    }


def _readers(bars: bool, slows: bool) -> dict[str, Any]:
    barred = {'keepout_filter': _filter(KEEP_OUT, 'KeepoutFilter')} if bars else {}
    slowed = {'speed_filter': _filter(SPEED, 'SpeedFilter')} if slows else {}
    found: dict[str, Any] = {}
    for name, filters in (('global_costmap', barred | slowed), ('local_costmap', barred)):
        if filters:
            found[name] = {name: {_VALUES: {'filters': [*filters], **filters}}}
    if slows:
        # The filter tells it in the namespace of its costmap.
        found['controller_server'] = {_VALUES: {'speed_limit_topic': 'global_costmap/speed_limit'}}
    return found


def _filter(kind: str, plugin: str) -> dict[str, Any]:
    found = {'plugin': f'nav2_costmap_2d::{plugin}', 'enabled': True}
    return found | {'filter_info_topic': _info(kind)}


def _info(kind: str) -> str:
    return f'/{kind}_costmap_filter_info'
