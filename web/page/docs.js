// The API's description from /openapi.json alone: works without a network, as everything here.

const root = document.getElementById("docs");
const make = (tag, text = "") => Object.assign(document.createElement(tag), { textContent: text });

function resolved(schema, all, depth = 0) {
  if (!schema || typeof schema !== "object" || depth > 6) return schema;
  if (schema.$ref) return resolved(all[schema.$ref.split("/").pop()], all, depth + 1);
  if (Array.isArray(schema)) return schema.map((part) => resolved(part, all, depth + 1));
  return Object.fromEntries(Object.entries(schema).filter(([key]) => key !== "title").map(([key, part]) => [key, resolved(part, all, depth + 1)]));
}

function entry(path, method, operation, all) {
  const box = make("details");
  const head = make("summary");
  head.append(make("b", method.toUpperCase()), make("code", path), make("span", (operation.description ?? "").split(". ")[0]));
  box.append(head, make("p", operation.description ?? ""));
  for (const part of operation.parameters ?? []) box.append(make("p", `${part.name} (${part.in}) ${part.description ?? ""}`));
  const body = operation.requestBody?.content?.["application/json"]?.schema;
  if (body) box.append(make("p", "Body:"), make("pre", JSON.stringify(resolved(body, all), null, 2)));
  for (const [status, answer] of Object.entries(operation.responses ?? {})) {
    box.append(make("p", `${status}: ${answer.description}`));
    const schema = answer.content?.["application/json"]?.schema;
    if (schema && status.startsWith("2")) box.append(make("pre", JSON.stringify(resolved(schema, all), null, 2)));
  }
  return box;
}

const description = await (await fetch("/openapi.json")).json();
const all = description.components?.schemas ?? {};
const groups = {};
for (const [path, methods] of Object.entries(description.paths)) {
  for (const [method, operation] of Object.entries(methods)) (groups[operation.tags?.[0] ?? "other"] ??= []).push(entry(path, method, operation, all));
}
root.replaceChildren(make("h1", description.info.title), make("p", description.info.description));
for (const [name, entries] of Object.entries(groups)) root.append(make("h2", name), ...entries);
