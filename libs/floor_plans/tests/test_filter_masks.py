"""A place's zones as masks of Nav2's costmap filters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from floor_plans import read_place
from floor_plans.filter_masks import write_filter_masks
from floor_plans.occupancy_map import read_map

PLACE = Path(__file__).with_name('places') / 'seven_rooms.yaml'


SQUARE = [8.5, 8.6, 9.5, 8.6, 9.5, 10.0, 8.5, 10.0]


SHOP = [0.3, 13.0, 10.0, 18.0, 10.0, 18.0, 14.5, 13.0, 14.5]


def place_with(folder: Path, **tables: dict[str, Any]) -> Path:
    text = PLACE.read_text()
    for table, entries in tables.items():
        text += f'    {table}:\n' + ''.join(f'      {n}: {v}\n' for n, v in entries.items())
    file = folder / 'place.yaml'
    file.write_text(text)
    return file


def test_nav2_reads_the_same_zones_from_the_masks(tmp_path: Path) -> None:
    file = place_with(tmp_path, keep_out_zones={'S': SQUARE}, slow_zones={'A': SHOP})
    plan = read_place(file).plan
    keep_out, speed, parameters = write_filter_masks(plan, tmp_path / 'masks')
    servers = yaml.safe_load(parameters.read_text())
    info = servers['speed_costmap_filter_info_server']['ros__parameters']
    assert info['type'] == 2
    assert servers['keepout_costmap_filter_info_server']['ros__parameters']['type'] == 0
    grid = plan.grid()
    barred, slow = read_map(keep_out).grid, read_map(speed).grid
    assert barred.cells.shape == grid.cells.shape
    assert barred.at(barred.cells, 9.0, 9.0) == 100
    assert barred.at(barred.cells, 10.0, 9.0) == 0
    found = slow.at(slow.cells, 15.0, 12.0) * info['multiplier'] + info['base']
    assert found == pytest.approx(0.3, abs=0.003)
    assert slow.at(slow.cells, 10.0, 12.0) == 0, 'no limit'


def test_servers_and_costmaps_name_the_same_topics_wherever_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The costmaps' nodes have namespaces of their own, and map_server starts in any folder."""
    plan = read_place(
        place_with(tmp_path, keep_out_zones={'S': SQUARE}, slow_zones={'A': SHOP})
    ).plan
    monkeypatch.chdir(tmp_path)
    given = yaml.safe_load(write_filter_masks(plan, Path('masks'))[-1].read_text())
    costmaps = {
        name: given[name][name]['ros__parameters'] for name in ('global_costmap', 'local_costmap')
    }
    assert costmaps['global_costmap']['filters'] == ['keepout_filter', 'speed_filter']
    assert costmaps['local_costmap']['filters'] == ['keepout_filter']
    for kind in ('keepout', 'speed'):
        server = given[f'{kind}_filter_mask_server']['ros__parameters']
        info = given[f'{kind}_costmap_filter_info_server']['ros__parameters']
        heard = costmaps['global_costmap'][f'{kind}_filter']['filter_info_topic']
        assert info['filter_info_topic'] == heard
        assert info['mask_topic'] == server['topic_name']
        assert heard.startswith('/')
        assert info['mask_topic'].startswith('/')
        assert Path(server['yaml_filename']) == tmp_path / 'masks' / f'{kind}_mask.yaml'
