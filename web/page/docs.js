// The page of the API, made from /openapi.json alone: it needs no network, as the whole console. A
// call that only reads can be tried on the page; every call can be copied for a shell.

import { takeOver } from "./core/stop.js";
import { tellStopped } from "./core/stop_beside.js";
import "./core/theme.js";

takeOver(tellStopped);
const MAX_DEPTH = 6;
const MAX_SHOWN = 4000;
const root = document.getElementById("docs");

function make(tag, text = "", properties = {}) {
  const node = Object.assign(document.createElement(tag), properties);
  // Words between back-ticks are code.
  text.split(/`([^`]+)`/).forEach((part, i) => {
    if (i % 2) node.append(Object.assign(document.createElement("code"), { textContent: part }));
    else node.append(part);
  });
  return node;
}

const plain = (tag, text, properties = {}) =>
  Object.assign(document.createElement(tag), { textContent: text, ...properties });

// The schema with its references replaced by what they name.
function resolve(schema, schemas, depth = 0) {
  if (!schema || typeof schema !== "object" || depth > MAX_DEPTH) return schema;
  if (schema.$ref) return resolve(schemas[schema.$ref.split("/").pop()], schemas, depth + 1);
  if (Array.isArray(schema)) return schema.map((part) => resolve(part, schemas, depth + 1));
  const entries = Object.entries(schema).filter(([key]) => key !== "title");
  return Object.fromEntries(entries.map(([key, part]) => [key, resolve(part, schemas, depth + 1)]));
}

// A value that a schema allows, as an example.
function exampleOf(schema) {
  if (!schema || typeof schema !== "object") return null;
  if (schema.default !== undefined) return schema.default;
  if (schema.const !== undefined) return schema.const;
  if (schema.enum) return schema.enum[0];
  const choice = schema.anyOf ?? schema.oneOf;
  if (choice) return exampleOf(choice[0]);
  if (schema.type === "object" || schema.properties) {
    const entries = Object.entries(schema.properties ?? {});
    return Object.fromEntries(entries.map(([name, part]) => [name, exampleOf(part)]));
  }
  if (schema.type === "array") return schema.items ? [exampleOf(schema.items)] : [];
  return { number: 0.5, integer: 1, string: "text", boolean: true }[schema.type] ?? null;
}

function curlOf(path, method, body) {
  const parts = [`curl -X ${method.toUpperCase()} '${location.origin}${path}'`];
  if (body)
    parts.push(
      "-H 'Content-Type: application/json'",
      `-d '${JSON.stringify(exampleOf(body)).replaceAll("'", "'\\''")}'`,
    );
  return parts.join(" ");
}

function copyButton(text) {
  const button = plain("button", "Copy", { type: "button" });
  button.onclick = async () => {
    // Over plain HTTP a browser copies nothing for a page.
    try {
      await navigator.clipboard.writeText(text);
      button.textContent = "Copied";
    } catch {
      getSelection().selectAllChildren(button.previousElementSibling);
      button.textContent = "Selected: press Ctrl C";
    }
  };
  return button;
}

function tryButton(path, box) {
  const button = plain("button", "Try it", { type: "button" });
  button.dataset.testid = "docs-try";
  button.onclick = async () => {
    const answer = await fetch(path);
    const kind = answer.headers.get("content-type") ?? "";
    const isText = /json|text|yaml/.test(kind);
    const text = isText ? (await answer.text()).slice(0, MAX_SHOWN) : `(${kind})`;
    box.querySelector(".answer")?.remove();
    box.append(plain("pre", `${answer.status}\n${text}`, { className: "answer", tabIndex: 0 }));
  };
  return button;
}

function operationBox(path, method, operation, schemas) {
  const box = make("details");
  const head = make("summary");
  const description = operation.description ?? "";
  const jsonOf = (part) =>
    plain("pre", JSON.stringify(resolve(part, schemas), null, 2), { tabIndex: 0 });
  head.append(
    plain("b", method.toUpperCase()),
    plain("code", path),
    make("span", description.split(". ")[0]),
  );
  box.append(head, make("p", description));
  for (const part of operation.parameters ?? [])
    box.append(make("p", `\`${part.name}\` (${part.in}) ${part.description ?? ""}`));
  const body = operation.requestBody?.content?.["application/json"]?.schema;
  if (body) box.append(make("p", "Body:"), jsonOf(body));
  for (const [status, answer] of Object.entries(operation.responses ?? {})) {
    box.append(make("p", `${status}: ${answer.description}`));
    const schema = answer.content?.["application/json"]?.schema;
    if (schema && status.startsWith("2")) box.append(jsonOf(schema));
  }
  const command = curlOf(path, method, body && resolve(body, schemas));
  const row = make("div", "", { className: "command" });
  row.append(plain("pre", command, { tabIndex: 0 }), copyButton(command));
  if (method === "get" && !path.includes("{")) row.append(tryButton(path, box));
  box.append(row);
  return box;
}

const api = await (await fetch("/openapi.json")).json();
const groups = {};
for (const [path, methods] of Object.entries(api.paths)) {
  for (const [method, operation] of Object.entries(methods)) {
    const group = (groups[operation.tags?.[0] ?? "other"] ??= []);
    group.push(operationBox(path, method, operation, api.components?.schemas ?? {}));
  }
}
root.replaceChildren(make("h1", api.info.title), make("p", api.info.description));
for (const [name, boxes] of Object.entries(groups)) root.append(make("h2", name), ...boxes);
