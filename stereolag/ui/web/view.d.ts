// What components.py adds to the module of a component: its markup.
declare const view: (panel: any, data: any, words: any, tools: any) => unknown;
