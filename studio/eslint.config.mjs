import { defineConfig } from "eslint/config";
import { configs } from "typescript-eslint";

const languageOptions = { parserOptions: { projectService: true } };
// node's runner waits for its tests itself
const allowForKnownSafeCalls = [{ from: "package", name: "test", package: "node:test" }];

export default defineConfig(
  { files: ["src/**/*.ts", "test/*.ts"], extends: [configs.recommendedTypeChecked], languageOptions },
  {
    files: ["test/*.ts"],
    rules: { "@typescript-eslint/no-floating-promises": ["error", { allowForKnownSafeCalls }] },
  },
);
