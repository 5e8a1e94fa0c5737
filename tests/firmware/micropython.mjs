// Runs a Python program that comes by standard input as JSON, with the files it imports, in
// MicroPython's own interpreter (its WebAssembly port); what it prints is printed.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [folder] = process.argv.slice(2);
const path = `${folder}/@micropython/micropython-webassembly-pyscript/micropython.mjs`;
const { loadMicroPython } = await import(pathToFileURL(path));
const { files, program } = JSON.parse(readFileSync(0, "utf8"));
const python = await loadMicroPython({ heapsize: 4 << 20 });
for (const [name, text] of Object.entries(files)) python.FS.writeFile(`/${name}`, text);
try {
  python.runPython(program);
} catch (error) {
  // Uncaught, node would print the interpreter's one long line first and be cut off.
  console.error(error.message);
  process.exitCode = 1;
}
