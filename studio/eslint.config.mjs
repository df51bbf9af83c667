import { defineConfig } from "eslint/config";
import { configs } from "typescript-eslint";

export default defineConfig({
  files: ["src/**/*.ts"],
  extends: [configs.recommendedTypeChecked],
  languageOptions: { parserOptions: { projectService: true } },
});
