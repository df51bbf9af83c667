// The page as one file, but for the mechanisms: those are put in by `python -m analysis.studio`.
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { build, transform } from "esbuild";

const options = { bundle: true, minify: true, write: false, target: "es2022", legalComments: "none" };
/** Style sheets that scripts import, as text without what people need to read them. */
const styles = {
  name: "styles",
  setup: ({ onLoad }) =>
    onLoad({ filter: /\.css$/ }, async ({ path }) => ({
      contents: (await transform(readFileSync(path, "utf8"), { loader: "css", minify: true })).code.trim(),
      loader: "text",
    })),
};
const worker = await build({ ...options, entryPoints: ["src/worker.ts"], format: "iife" });
const page = await build({
  ...options,
  entryPoints: ["src/main.ts"],
  format: "iife",
  plugins: [styles],
  define: { WORKER: JSON.stringify(worker.outputFiles[0].text) },
});
const style = await build({ ...options, entryPoints: ["src/style.css"] });
const parts = {
  STYLE: style.outputFiles[0].text,
  SCRIPT: page.outputFiles[0].text.replaceAll("</script", "<\\/script"),
};
const html = readFileSync("index.html", "utf8")
  .replace(/\s*\n\s*/g, " ")
  .replace(/<!--(STYLE|SCRIPT)-->/g, (_, name) => parts[name]);
mkdirSync("build", { recursive: true });
writeFileSync("build/page.html", html);
