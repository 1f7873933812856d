// lit-html 3.3.3 (https://github.com/lit/lit), its html, svg, render and live alone, bundled and minified by esbuild.
//
// BSD 3-Clause License
//
// Copyright (c) 2017 Google LLC. All rights reserved.
//
// Redistribution and use in source and binary forms, with or without
// modification, are permitted provided that the following conditions are met:
//
// 1. Redistributions of source code must retain the above copyright notice, this
//    list of conditions and the following disclaimer.
//
// 2. Redistributions in binary form must reproduce the above copyright notice,
//    this list of conditions and the following disclaimer in the documentation
//    and/or other materials provided with the distribution.
//
// 3. Neither the name of the copyright holder nor the names of its
//    contributors may be used to endorse or promote products derived from
//    this software without specific prior written permission.
//
// THIS SOFTWARE IS PROVIDED BY THE COPYRIGHT HOLDERS AND CONTRIBUTORS "AS IS"
// AND ANY EXPRESS OR IMPLIED WARRANTIES, INCLUDING, BUT NOT LIMITED TO, THE
// IMPLIED WARRANTIES OF MERCHANTABILITY AND FITNESS FOR A PARTICULAR PURPOSE ARE
// DISCLAIMED. IN NO EVENT SHALL THE COPYRIGHT HOLDER OR CONTRIBUTORS BE LIABLE
// FOR ANY DIRECT, INDIRECT, INCIDENTAL, SPECIAL, EXEMPLARY, OR CONSEQUENTIAL
// DAMAGES (INCLUDING, BUT NOT LIMITED TO, PROCUREMENT OF SUBSTITUTE GOODS OR
// SERVICES; LOSS OF USE, DATA, OR PROFITS; OR BUSINESS INTERRUPTION) HOWEVER
// CAUSED AND ON ANY THEORY OF LIABILITY, WHETHER IN CONTRACT, STRICT LIABILITY,
// OR TORT (INCLUDING NEGLIGENCE OR OTHERWISE) ARISING IN ANY WAY OUT OF THE USE
// OF THIS SOFTWARE, EVEN IF ADVISED OF THE POSSIBILITY OF SUCH DAMAGE.
// @ts-nocheck
var lit=(()=>{var O=Object.defineProperty;var lt=Object.getOwnPropertyDescriptor;var at=Object.getOwnPropertyNames;var $t=Object.prototype.hasOwnProperty;var At=(i,t)=>{for(var e in t)O(i,e,{get:t[e],enumerable:!0})},_t=(i,t,e,s)=>{if(t&&typeof t=="object"||typeof t=="function")for(let n of at(t))!$t.call(i,n)&&n!==e&&O(i,n,{get:()=>t[n],enumerable:!(s=lt(t,n))||s.enumerable});return i};var ct=i=>_t(O({},"__esModule",{value:!0}),i);var mt={};At(mt,{html:()=>K,live:()=>ht,render:()=>it,svg:()=>X});var w=globalThis,k=i=>i,M=w.trustedTypes,Y=M?M.createPolicy("lit-html",{createHTML:i=>i}):void 0,D="$lit$",p=`lit$${Math.random().toFixed(9).slice(2)}$`,V="?"+p,dt=`<${V}>`,g=w.document===void 0?{createTreeWalker:()=>({})}:document,N=()=>g.createComment(""),E=i=>i===null||typeof i!="object"&&typeof i!="function",j=Array.isArray,q=i=>j(i)||typeof i?.[Symbol.iterator]=="function",L=`[ 	
\f\r]`,H=/<(?:(!--|\/[^a-zA-Z])|(\/?[a-zA-Z][^>\s]*)|(\/?$))/g,Z=/-->/g,F=/>/g,m=RegExp(`>|${L}(?:([^\\s"'>=/]+)(${L}*=${L}*(?:[^ 	
\f\r"'\`<>=]|("|')|))|$)`,"g"),z=/'/g,G=/"/g,J=/^(?:script|style|textarea|title)$/i,W=i=>(t,...e)=>({_$litType$:i,strings:t,values:e}),K=W(1),X=W(2),gt=W(3),c=Symbol.for("lit-noChange"),a=Symbol.for("lit-nothing"),Q=new WeakMap,v=g.createTreeWalker(g,129);function tt(i,t){if(!j(i)||!i.hasOwnProperty("raw"))throw Error("invalid template strings array");return Y!==void 0?Y.createHTML(t):t}var et=(i,t)=>{let e=i.length-1,s=[],n,r=t===2?"<svg>":t===3?"<math>":"",o=H;for(let _=0;_<e;_++){let h=i[_],$,A,l=-1,d=0;for(;d<h.length&&(o.lastIndex=d,A=o.exec(h),A!==null);)d=o.lastIndex,o===H?A[1]==="!--"?o=Z:A[1]!==void 0?o=F:A[2]!==void 0?(J.test(A[2])&&(n=RegExp("</"+A[2],"g")),o=m):A[3]!==void 0&&(o=m):o===m?A[0]===">"?(o=n??H,l=-1):A[1]===void 0?l=-2:(l=o.lastIndex-A[2].length,$=A[1],o=A[3]===void 0?m:A[3]==='"'?G:z):o===G||o===z?o=m:o===Z||o===F?o=H:(o=m,n=void 0);let u=o===m&&i[_+1].startsWith("/>")?" ":"";r+=o===H?h+dt:l>=0?(s.push($),h.slice(0,l)+D+h.slice(l)+p+u):h+p+(l===-2?_:u)}return[tt(i,r+(i[e]||"<?>")+(t===2?"</svg>":t===3?"</math>":"")),s]},C=class i{constructor({strings:t,_$litType$:e},s){let n;this.parts=[];let r=0,o=0,_=t.length-1,h=this.parts,[$,A]=et(t,e);if(this.el=i.createElement($,s),v.currentNode=this.el.content,e===2||e===3){let l=this.el.content.firstChild;l.replaceWith(...l.childNodes)}for(;(n=v.nextNode())!==null&&h.length<_;){if(n.nodeType===1){if(n.hasAttributes())for(let l of n.getAttributeNames())if(l.endsWith(D)){let d=A[o++],u=n.getAttribute(l).split(p),b=/([.?@])?(.*)/.exec(d);h.push({type:1,index:r,name:b[2],strings:u,ctor:b[1]==="."?R:b[1]==="?"?P:b[1]==="@"?I:T}),n.removeAttribute(l)}else l.startsWith(p)&&(h.push({type:6,index:r}),n.removeAttribute(l));if(J.test(n.tagName)){let l=n.textContent.split(p),d=l.length-1;if(d>0){n.textContent=M?M.emptyScript:"";for(let u=0;u<d;u++)n.append(l[u],N()),v.nextNode(),h.push({type:2,index:++r});n.append(l[d],N())}}}else if(n.nodeType===8)if(n.data===V)h.push({type:2,index:r});else{let l=-1;for(;(l=n.data.indexOf(p,l+1))!==-1;)h.push({type:7,index:r}),l+=p.length-1}r++}}static createElement(t,e){let s=g.createElement("template");return s.innerHTML=t,s}};function f(i,t,e=i,s){if(t===c)return t;let n=s!==void 0?e._$Co?.[s]:e._$Cl,r=E(t)?void 0:t._$litDirective$;return n?.constructor!==r&&(n?._$AO?.(!1),r===void 0?n=void 0:(n=new r(i),n._$AT(i,e,s)),s!==void 0?(e._$Co??=[])[s]=n:e._$Cl=n),n!==void 0&&(t=f(i,n._$AS(i,t.values),n,s)),t}var B=class{constructor(t,e){this._$AV=[],this._$AN=void 0,this._$AD=t,this._$AM=e}get parentNode(){return this._$AM.parentNode}get _$AU(){return this._$AM._$AU}u(t){let{el:{content:e},parts:s}=this._$AD,n=(t?.creationScope??g).importNode(e,!0);v.currentNode=n;let r=v.nextNode(),o=0,_=0,h=s[0];for(;h!==void 0;){if(o===h.index){let $;h.type===2?$=new x(r,r.nextSibling,this,t):h.type===1?$=new h.ctor(r,h.name,h.strings,this,t):h.type===6&&($=new U(r,this,t)),this._$AV.push($),h=s[++_]}o!==h?.index&&(r=v.nextNode(),o++)}return v.currentNode=g,n}p(t){let e=0;for(let s of this._$AV)s!==void 0&&(s.strings!==void 0?(s._$AI(t,s,e),e+=s.strings.length-2):s._$AI(t[e])),e++}},x=class i{get _$AU(){return this._$AM?._$AU??this._$Cv}constructor(t,e,s,n){this.type=2,this._$AH=a,this._$AN=void 0,this._$AA=t,this._$AB=e,this._$AM=s,this.options=n,this._$Cv=n?.isConnected??!0}get parentNode(){let t=this._$AA.parentNode,e=this._$AM;return e!==void 0&&t?.nodeType===11&&(t=e.parentNode),t}get startNode(){return this._$AA}get endNode(){return this._$AB}_$AI(t,e=this){t=f(this,t,e),E(t)?t===a||t==null||t===""?(this._$AH!==a&&this._$AR(),this._$AH=a):t!==this._$AH&&t!==c&&this._(t):t._$litType$!==void 0?this.$(t):t.nodeType!==void 0?this.T(t):q(t)?this.k(t):this._(t)}O(t){return this._$AA.parentNode.insertBefore(t,this._$AB)}T(t){this._$AH!==t&&(this._$AR(),this._$AH=this.O(t))}_(t){this._$AH!==a&&E(this._$AH)?this._$AA.nextSibling.data=t:this.T(g.createTextNode(t)),this._$AH=t}$(t){let{values:e,_$litType$:s}=t,n=typeof s=="number"?this._$AC(t):(s.el===void 0&&(s.el=C.createElement(tt(s.h,s.h[0]),this.options)),s);if(this._$AH?._$AD===n)this._$AH.p(e);else{let r=new B(n,this),o=r.u(this.options);r.p(e),this.T(o),this._$AH=r}}_$AC(t){let e=Q.get(t.strings);return e===void 0&&Q.set(t.strings,e=new C(t)),e}k(t){j(this._$AH)||(this._$AH=[],this._$AR());let e=this._$AH,s,n=0;for(let r of t)n===e.length?e.push(s=new i(this.O(N()),this.O(N()),this,this.options)):s=e[n],s._$AI(r),n++;n<e.length&&(this._$AR(s&&s._$AB.nextSibling,n),e.length=n)}_$AR(t=this._$AA.nextSibling,e){for(this._$AP?.(!1,!0,e);t!==this._$AB;){let s=k(t).nextSibling;k(t).remove(),t=s}}setConnected(t){this._$AM===void 0&&(this._$Cv=t,this._$AP?.(t))}},T=class{get tagName(){return this.element.tagName}get _$AU(){return this._$AM._$AU}constructor(t,e,s,n,r){this.type=1,this._$AH=a,this._$AN=void 0,this.element=t,this.name=e,this._$AM=n,this.options=r,s.length>2||s[0]!==""||s[1]!==""?(this._$AH=Array(s.length-1).fill(new String),this.strings=s):this._$AH=a}_$AI(t,e=this,s,n){let r=this.strings,o=!1;if(r===void 0)t=f(this,t,e,0),o=!E(t)||t!==this._$AH&&t!==c,o&&(this._$AH=t);else{let _=t,h,$;for(t=r[0],h=0;h<r.length-1;h++)$=f(this,_[s+h],e,h),$===c&&($=this._$AH[h]),o||=!E($)||$!==this._$AH[h],$===a?t=a:t!==a&&(t+=($??"")+r[h+1]),this._$AH[h]=$}o&&!n&&this.j(t)}j(t){t===a?this.element.removeAttribute(this.name):this.element.setAttribute(this.name,t??"")}},R=class extends T{constructor(){super(...arguments),this.type=3}j(t){this.element[this.name]=t===a?void 0:t}},P=class extends T{constructor(){super(...arguments),this.type=4}j(t){this.element.toggleAttribute(this.name,!!t&&t!==a)}},I=class extends T{constructor(t,e,s,n,r){super(t,e,s,n,r),this.type=5}_$AI(t,e=this){if((t=f(this,t,e,0)??a)===c)return;let s=this._$AH,n=t===a&&s!==a||t.capture!==s.capture||t.once!==s.once||t.passive!==s.passive,r=t!==a&&(s===a||n);n&&this.element.removeEventListener(this.name,this,s),r&&this.element.addEventListener(this.name,this,t),this._$AH=t}handleEvent(t){typeof this._$AH=="function"?this._$AH.call(this.options?.host??this.element,t):this._$AH.handleEvent(t)}},U=class{constructor(t,e,s){this.element=t,this.type=6,this._$AN=void 0,this._$AM=e,this.options=s}get _$AU(){return this._$AM._$AU}_$AI(t){f(this,t)}},st={M:D,P:p,A:V,C:1,L:et,R:B,D:q,V:f,I:x,H:T,N:P,U:I,B:R,F:U},pt=w.litHtmlPolyfillSupport;pt?.(C,x),(w.litHtmlVersions??=[]).push("3.3.3");var it=(i,t,e)=>{let s=e?.renderBefore??t,n=s._$litPart$;if(n===void 0){let r=e?.renderBefore??null;s._$litPart$=n=new x(t.insertBefore(N(),r),r,void 0,e??{})}return n._$AI(i),n};var y={ATTRIBUTE:1,CHILD:2,PROPERTY:3,BOOLEAN_ATTRIBUTE:4,EVENT:5,ELEMENT:6},nt=i=>(...t)=>({_$litDirective$:i,values:t}),S=class{constructor(t){}get _$AU(){return this._$AM._$AU}_$AT(t,e,s){this._$Ct=t,this._$AM=e,this._$Ci=s}_$AS(t,e){return this.update(t,e)}update(t,e){return this.render(...e)}};var{I:xt}=st;var rt=i=>i.strings===void 0;var ut={},ot=(i,t=ut)=>i._$AH=t;var ht=nt(class extends S{constructor(i){if(super(i),i.type!==y.PROPERTY&&i.type!==y.ATTRIBUTE&&i.type!==y.BOOLEAN_ATTRIBUTE)throw Error("The `live` directive is not allowed on child or event bindings");if(!rt(i))throw Error("`live` bindings can only contain a single expression")}render(i){return i}update(i,[t]){if(t===c||t===a)return t;let e=i.element,s=i.name;if(i.type===y.PROPERTY){if(t===e[s])return c}else if(i.type===y.BOOLEAN_ATTRIBUTE){if(!!t===e.hasAttribute(s))return c}else if(i.type===y.ATTRIBUTE&&e.getAttribute(s)===t+"")return c;return ot(i),t}});return ct(mt);})();
/*! Bundled license information:

lit-html/node/lit-html.js:
lit-html/node/directive.js:
  (**
   * @license
   * Copyright 2017 Google LLC
   * SPDX-License-Identifier: BSD-3-Clause
   *)

lit-html/node/directive-helpers.js:
lit-html/node/directives/live.js:
  (**
   * @license
   * Copyright 2020 Google LLC
   * SPDX-License-Identifier: BSD-3-Clause
   *)
*/
export const html = lit.html;
export const svg = lit.svg;
export const render = lit.render;
export const live = lit.live;
