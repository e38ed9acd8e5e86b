// The marks of one image: a label per pixel, 0 where nothing is said, and their history.

const MAX_UNDO = 60;

export function makeLabels(width, height, values = new Uint8Array(width * height)) {
  let undone = [];
  const done = [];
  const labels = {
    width,
    height,
    values,
    canUndo: () => done.length > 0,
    canRedo: () => undone.length > 0,
    // Call before an edit begins.
    remember() {
      done.push(labels.values.slice());
      if (done.length > MAX_UNDO) done.shift();
      undone = [];
    },
    undo() {
      undone.push(labels.values);
      labels.values = done.pop();
    },
    redo() {
      done.push(labels.values);
      labels.values = undone.pop();
    },
    // A disc of one label around a pixel, and along the line from the pixel before.
    paint(from, to, radius, label) {
      const steps = Math.max(1, Math.ceil(Math.hypot(to.col - from.col, to.row - from.row)));
      for (let i = 0; i <= steps; i += 1) {
        const share = i / steps;
        disc(
          labels,
          from.row + share * (to.row - from.row),
          from.col + share * (to.col - from.col),
          radius,
          label,
        );
      }
    },
    // One label wherever the runs of a region say 1.
    fill(runs, label) {
      let at = 0;
      for (let i = 0; i < runs.length; i += 2) {
        if (runs[i]) labels.values.fill(label, at, at + runs[i + 1]);
        at += runs[i + 1];
      }
    },
  };
  return labels;
}

function disc({ width, height, values }, row, col, radius, label) {
  const [top, bottom] = [Math.max(0, Math.ceil(row - radius)), Math.min(height - 1, Math.floor(row + radius))];
  for (let y = top; y <= bottom; y += 1) {
    const half = Math.sqrt(Math.max(0, radius * radius - (y - row) ** 2));
    const left = Math.max(0, Math.ceil(col - half));
    const right = Math.min(width - 1, Math.floor(col + half));
    if (left <= right) values.fill(label, y * width + left, y * width + right + 1);
  }
}

// The runs of the API: label and number of pixels by turns.
export function runsOf(values) {
  const runs = [];
  let start = 0;
  for (let i = 1; i <= values.length; i += 1) {
    if (i === values.length || values[i] !== values[start]) {
      runs.push(values[start], i - start);
      start = i;
    }
  }
  return runs;
}

// The labels of runs whose classes are known here by other numbers.
export function valuesOf(runs, count, numbers) {
  const values = new Uint8Array(count);
  let at = 0;
  for (let i = 0; i < runs.length; i += 2) {
    values.fill(numbers[runs[i]], at, at + runs[i + 1]);
    at += runs[i + 1];
  }
  return values;
}
