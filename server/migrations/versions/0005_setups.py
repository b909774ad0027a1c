"""Set-ups of results, so that a comparison groups them without reading their documents; a result's study."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None

FACTS = (
    *("traversal", "method", "layout", "intersector", "box", "nodes", "precision", "offset", "builder"),
    *("scene", "device_id", "device_name", "device_driver", "device_threads", "size", "rays_kind", "specialised"),
    *("sah_traversal", "sah_intersection", "versions_rayfarm", "versions_plan", "versions_shader_sha", "family"),
)
OBJECTS = ("device", "sah", "frame_ms", "rays", "per_ray", "error", "vs_embree", "versions")
COLUMNS = (
    *(name for name in FACTS if name != "specialised"),
    *(
        "triangles",
        "device_kind",
        "sah_cost",
        "frames",
        "frame_ms_median",
        "frame_ms_ci_low",
        "frame_ms_ci_high",
        "fps",
    ),
    *("mrays_per_s", "mrays_per_cpu_s", "rays_timed", "rays_primary", "rays_shadow"),
    *("structure_bytes", "primitive_bytes", "build_ms"),
    *("per_ray_nodes", "per_ray_inner", "per_ray_leaves", "per_ray_triangles", "per_ray_bytes", "per_ray_lines"),
    *("overflows", "error_false_hit", "error_false_miss", "error_edge", "error_wrong_primitive"),
    *("error_t_rel_p99", "error_t_rel_max", "error_t_ulp_max", "error_shadow_mismatch", "error_flip"),
    *("vs_embree_mrays_per_cpu_s", "vs_embree_ratio", "started_at"),
)
"""The columns of every table; `fields` of a set-up names the others."""
CHUNK = 500
SETUPS = sa.table("setups", sa.column("id"), sa.column("digest"), sa.column("facts", sa.JSON))
RESULTS = sa.table("results", sa.column("id"), sa.column("setup_id"), sa.column("document", sa.JSON))


def upgrade() -> None:
    """Create the table, give results their new columns, and fill them from their documents and jobs."""
    op.create_table(
        "setups",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("digest", sa.String(64), nullable=False, unique=True),
        sa.Column("facts", sa.JSON, nullable=False),
    )
    op.add_column("results", sa.Column("study_id", sa.Integer, nullable=True))
    op.add_column("results", sa.Column("setup_id", sa.Integer, nullable=True))
    op.execute("UPDATE results SET study_id = (SELECT study_id FROM jobs WHERE jobs.id = results.job_id)")
    _fill(op.get_bind())
    with op.batch_alter_table("results") as results:
        results.alter_column("setup_id", existing_type=sa.Integer, nullable=False)
        results.create_foreign_key("fk_results_study_id", "studies", ["study_id"], ["id"])
        results.create_foreign_key("fk_results_setup_id", "setups", ["setup_id"], ["id"])
        results.create_index("ix_results_setup", ["setup_id", "study_id", "id"])
        results.create_index("ix_results_study", ["study_id", "setup_id", "id"])


def downgrade() -> None:
    """Drop what was added."""
    with op.batch_alter_table("results") as results:
        results.drop_index("ix_results_study")
        results.drop_index("ix_results_setup")
        results.drop_constraint("fk_results_setup_id", type_="foreignkey")
        results.drop_constraint("fk_results_study_id", type_="foreignkey")
        results.drop_column("setup_id")
        results.drop_column("study_id")
    op.drop_table("setups")


def _fill(connection: sa.Connection) -> None:
    known: dict[str, int] = {}
    last = 0
    page = sa.select(RESULTS.c.id, RESULTS.c.document).order_by(RESULTS.c.id).limit(CHUNK)
    set_setup = sa.update(RESULTS).where(RESULTS.c.id == sa.bindparam("result"))
    while rows := connection.execute(page.where(RESULTS.c.id > last)).all():
        changes = [{"result": number, "setup_id": _setup(connection, known, document)} for number, document in rows]
        connection.execute(set_setup, changes)
        last = rows[-1][0]


def _setup(connection: sa.Connection, known: dict[str, int], document: dict[str, Any]) -> int:
    flat = {"size": ""} | dict(_flat("", document))
    facts: dict[str, Any] = {name: flat.get(name) for name in FACTS}
    facts["fields"] = [name for name in flat if name not in COLUMNS]
    digest = hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()
    if digest not in known:
        added = sa.insert(SETUPS).values(digest=digest, facts=facts).returning(SETUPS.c.id)
        known[digest] = connection.execute(added).scalar_one()
    return known[digest]


def _flat(prefix: str, value: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    for key, item in value.items():
        name = f"{prefix}{key}"
        if name == "size":
            yield name, "x".join(str(side) for side in item or ())
        elif isinstance(item, dict):
            yield from _flat(f"{name}_", item)
        elif item is not None or name not in OBJECTS:
            yield name, json.dumps(item) if isinstance(item, list) else item
