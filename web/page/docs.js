// The page of the API, made from /openapi.json alone: it needs no network, as the whole console.

const MAX_DEPTH = 6;
const root = document.getElementById("docs");
const make = (tag, text = "") => Object.assign(document.createElement(tag), { textContent: text });

// The schema with its references replaced by what they name.
function resolve(schema, schemas, depth = 0) {
  if (!schema || typeof schema !== "object" || depth > MAX_DEPTH) return schema;
  if (schema.$ref) return resolve(schemas[schema.$ref.split("/").pop()], schemas, depth + 1);
  if (Array.isArray(schema)) return schema.map((part) => resolve(part, schemas, depth + 1));
  const entries = Object.entries(schema).filter(([key]) => key !== "title");
  return Object.fromEntries(entries.map(([key, part]) => [key, resolve(part, schemas, depth + 1)]));
}

function operationBox(path, method, operation, schemas) {
  const box = make("details");
  const head = make("summary");
  const description = operation.description ?? "";
  const jsonOf = (part) => make("pre", JSON.stringify(resolve(part, schemas), null, 2));
  head.append(
    make("b", method.toUpperCase()),
    make("code", path),
    make("span", description.split(". ")[0]),
  );
  box.append(head, make("p", description));
  for (const part of operation.parameters ?? [])
    box.append(make("p", `${part.name} (${part.in}) ${part.description ?? ""}`));
  const body = operation.requestBody?.content?.["application/json"]?.schema;
  if (body) box.append(make("p", "Body:"), jsonOf(body));
  for (const [status, answer] of Object.entries(operation.responses ?? {})) {
    box.append(make("p", `${status}: ${answer.description}`));
    const schema = answer.content?.["application/json"]?.schema;
    if (schema && status.startsWith("2")) box.append(jsonOf(schema));
  }
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
