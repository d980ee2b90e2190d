import { defineConfig } from "vite";

// Relative addresses, so that the page works in any folder of any server.
export default defineConfig({
  base: "./",
  worker: { format: "es" },
  build: {
    target: "es2023",
    rollupOptions: { input: ["index.html", "pack.html"] },
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    license: { fileName: "licenses.md" }, // of what is bundled
  },
});
