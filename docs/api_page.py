"""The API's operations as Markdown, from the OpenAPI document that the application itself answers with."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from server.api.schema import METHODS
from server.app import create_app
from server.settings import Settings

Json = dict[str, Any]


def operations() -> str:
    """A section for each resource with its operations, then one for the bodies that they take."""
    document = create_app(Settings(database_url="sqlite://")).openapi()
    by_resource: dict[str, list[str]] = {}
    for path, methods in document["paths"].items():
        resource = path.removeprefix("/api/v1/").partition("/")[0]
        for method in METHODS:
            if method in methods:
                by_resource.setdefault(resource, []).append(_operation(method, path, methods[method]))
    sections = [f"## {resource.capitalize()}\n\n" + "\n".join(each) for resource, each in sorted(by_resource.items())]
    bodies = [_body(name, schema) for name, schema in document["components"]["schemas"].items()]
    return "\n".join([*sections, "## Bodies\n", *bodies])


def _operation(method: str, path: str, operation: Mapping[str, Any]) -> str:
    parts = [f"### {method.upper()} {_code(path)}\n", _sentence(operation)]
    taken = operation.get("requestBody", {}).get("content", {})
    names = [_link(content["schema"]) for content in taken.values() if "$ref" in content["schema"]]
    said = [f"Scope: {_code(operation['x-scope'])}."]
    said += [f"Body: {name}." for name in names]
    said += [f"Answer: {', '.join(_answers(operation['responses']))}."]
    parts.append(" ".join(said) + "\n")
    parameters = [one for one in operation.get("parameters", ()) if one["in"] != "path"]
    if parameters:
        rows = ((one["name"], one["in"], one["schema"], one.get("description")) for one in parameters)
        parts.append(_table(("parameter", "in"), rows))
    return "\n".join(parts)


def _sentence(operation: Mapping[str, Any]) -> str:
    return f"{operation.get('description', operation['summary'])}\n"


def _answers(responses: Mapping[str, Any]) -> Iterator[str]:
    for status, response in responses.items():
        kinds = " or ".join(_code(kind) for kind in response.get("content", {}))
        if status != "default":
            yield f"{status} {kinds}".strip()


def _body(name: str, schema: Mapping[str, Any]) -> str:
    required = schema.get("required", ())
    rows = (
        (field, "yes" if field in required else "no", about, about.get("description"))
        for field, about in schema["properties"].items()
    )
    return f"### {name}\n\n{schema.get('description', '')}\n\n{_table(('field', 'required'), rows)}"


def _table(heads: tuple[str, str], rows: Iterator[tuple[str, str, Mapping[str, Any], str | None]]) -> str:
    lines = [f"| {heads[0]} | {heads[1]} | type | default | meaning |", "|---|---|---|---|---|"]
    for name, second, schema, text in rows:
        default = "" if schema.get("default") is None else _code(json.dumps(schema["default"]))
        cells = (_code(name), second, _type(schema), default, (text or "").replace("|", "\\|"))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _type(schema: Mapping[str, Any]) -> str:
    if "$ref" in schema:
        return _link(schema)
    if "anyOf" in schema:
        return " or ".join(_type(one) for one in schema["anyOf"])
    if "enum" in schema:
        return ", ".join(_code(value) for value in schema["enum"])
    if "prefixItems" in schema:
        return f"list of {len(schema['prefixItems'])} {_type(schema['prefixItems'][0])}s"
    if schema.get("type") == "array":
        return f"list of {_type(schema.get('items', {}))}"
    limits = [f"{word} {schema[key]:g}" for key, word in (("minimum", "from"), ("maximum", "to")) if key in schema]
    return " ".join([schema.get("type", "any"), *limits])


def _link(schema: Mapping[str, Any]) -> str:
    name = schema["$ref"].rpartition("/")[2]
    return f"[{name}](#{name.lower()})"


def _code(text: object) -> str:
    return f"`{text}`"
