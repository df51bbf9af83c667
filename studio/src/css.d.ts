declare module "*.css" {
  const text: string;
  export default text;
}
/** The script of the worker, put in by build.mjs. */
declare const WORKER: string;
